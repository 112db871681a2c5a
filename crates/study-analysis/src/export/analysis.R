#' Reads the tables of this folder, describes them, and compares its numbers with those
#' of `study analyze`, which are in `headline.csv`. It needs R 4.1 or later with the
#' packages lme4, lmerTest and ordinal, and no network.
#'
#' Every text of the study (title, questions, ids, comments) is read from the tables and
#' is never code.

# The folder of the script, if it was started with Rscript.
started <- sub("^--file=", "", grep("^--file=", commandArgs(FALSE), value = TRUE))
if (length(started) == 1 && basename(started) == "analysis.R") setwd(dirname(started))
options(digits = 10, width = 100)

#' ## Reading
#'
#' Every column gets the type that `dictionary.csv` states; none is guessed. A
#' participant called `NA` or `1e5` stays text. Factors have the levels of `labels.csv`,
#' in the order of the protocol and not of the locale.

read_text <- function(file) {
  read.csv(file, colClasses = "character", na.strings = "", check.names = FALSE,
           fill = FALSE, encoding = "UTF-8")
}
settings <- read_text("settings.csv")
setting <- function(key) settings$value[match(key, settings$key)]
cat(setting("title"), "\n", sep = "")

# SHA-256 of a file by what this machine has; NA if it has nothing.
sha256 <- function(file) {
  if (exists("sha256sum", envir = asNamespace("tools"), inherits = FALSE)) {
    return(unname(get("sha256sum", envir = asNamespace("tools"))(file)))
  }
  program <- Sys.which(c("sha256sum", "shasum"))
  if (nzchar(program[1])) return(substr(system2(program[1], shQuote(file), stdout = TRUE), 1, 64))
  if (nzchar(program[2])) {
    return(substr(system2(program[2], c("-a", "256", shQuote(file)), stdout = TRUE), 1, 64))
  }
  NA_character_
}
for (key in grep("^sha256 ", settings$key, value = TRUE)) {
  file <- sub("^sha256 ", "", key)
  digest <- sha256(file)
  if (is.na(digest)) {
    cat(file, ": its SHA-256 was not compared, no program computes it here\n", sep = "")
  } else if (digest != setting(key)) {
    stop(file, " was changed after the export")
  }
}

dictionary <- read_text("dictionary.csv")
labels <- read_text("labels.csv")
read_table <- function(name) {
  data <- read_text(paste0(name, ".csv"))
  for (column in names(data)) {
    about <- dictionary[dictionary$table == name & dictionary$column == column, ]
    values <- labels$value[labels$table == name & labels$column == column]
    text <- data[[column]]
    data[[column]] <- switch(about$type,
      "whole number" = as.numeric(text),
      "number" = as.numeric(text),
      "true or false" = text == "true",
      if (length(values) > 0) factor(text, levels = values) else text)
    if (any(is.na(data[[column]]) != is.na(text))) {
      stop(name, ".csv: column ", column, " has a value that its description excludes")
    }
  }
  data
}
ratings <- read_table("ratings")
participants <- read_table("participants")
realizations <- read_table("realizations")
ratings$participant <- factor(ratings$participant, levels = participants$participant)
cat(nrow(ratings), " trials of ", nrow(participants), " participants\n", sep = "")
print(table(status = ratings$status))

#' ## Rows that count
#'
#' `study` decided which rows count, by the states of the participants and the exclusion
#' rules of the protocol.

question <- setting("question")
has_ratings <- !is.na(question)
kept <- function(kind) sub(paste0("^", kind, " "), "", grep(paste0("^", kind, " "), settings$key, value = TRUE))
if (has_ratings) {
  print(table(because = ratings$not_used_because, useNA = "no"))
  counted <- ratings[ratings$included & !is.na(ratings[[question]]) & ratings$status != "failed", ]
  option <- setting("share of")
  counted$rating <- if (is.na(option)) counted[[question]] else (counted[[question]] == option) + 0
  counted$model <- droplevels(counted$model)
  repeats <- realizations$id[!is.na(realizations$duplicate_of)]
  tested <- counted[counted$role == "test" & !(counted$model %in% repeats), ]
  tested$model <- droplevels(tested$model)
  tested$participant <- droplevels(tested$participant)
} else {
  cat("The primary question is no rating. These are the answers and their numbers:\n")
  answered <- ratings[ratings$status == "ok" & !ratings$practice, ]
  if (any(!is.na(answered$correct) & !is.na(answered$level))) {
    print(aggregate(cbind(share_correct = correct) ~ participant + track + level,
                    data = answered, FUN = mean))
  }
  asked <- dictionary$column[dictionary$table == "ratings" & !is.na(dictionary$question)]
  for (column in asked) if (is.factor(answered[[column]])) print(table(answered[[column]]))
}

#' ## Mean and standard deviation of each realization

value <- numeric(0)
if (has_ratings) {
  described <- do.call(rbind, lapply(split(counted$rating, counted$model), function(x) {
    data.frame(n = length(x), mean = mean(x), sd = if (length(x) > 1) sd(x) else NA)
  }))
  print(described)
  for (model in rownames(described)) for (what in names(described)) {
    value[paste0("desc/", model, "/", what)] <- described[model, what]
  }
}

#' ## Effects of the factors
#'
#' The participants' means in each combination of levels, of those who rated every realization.
#' Each effect is tested by orthonormal contrasts of these means, in a multivariate linear model
#' with Greenhouse and Geisser's correction; with groups, sums of squares are of type III. Levels of a factor
#' are compared by t tests over participants and, if a margin of equivalence was stated, by two one-sided ones.

# F, degrees of freedom and p of one effect; `y` has a column for each contrast.
spherical <- function(y, group, of_group) {
  if (length(group) == 0) {
    full <- lm(y ~ 1)
    less <- lm(y ~ 0)
  } else {
    coded <- model.matrix(~ group, contrasts.arg = list(group = "contr.sum"))
    full <- lm(y ~ 0 + coded)
    less <- if (of_group) lm(y ~ 1) else lm(y ~ 0 + coded[, -1])
  }
  if (ncol(y) == 1) {
    found <- anova(less, full)
    return(c(F = found$F[2], df1 = found$Df[2], df2 = found$Res.Df[2], p_gg = found[["Pr(>F)"]][2]))
  }
  found <- anova(full, less, X = ~0, test = "Spherical")
  c(F = found$F[2], df1 = found[["num Df"]][2], df2 = found[["den Df"]][2], p_gg = found[["G-G Pr"]][2])
}
# A name in an identifier: what separates names there is written as its number.
in_id <- function(name) {
  for (mark in c("%", "/", "|", "=", "@", ",")) {
    name <- gsub(mark, sprintf("%%%02X", utf8ToInt(mark)), name, fixed = TRUE)
  }
  name
}
factors <- kept("factor")
if (has_ratings && length(factors) > 0) {
  of_models <- tested[!duplicated(tested$model), ]
  of_models <- of_models[order(of_models$model), ]
  combination <- interaction(of_models[factors], lex.order = TRUE)
  cells <- tapply(tested$rating, list(tested$participant, tested$model), mean)
  cells <- cells[rowSums(is.na(cells)) == 0, , drop = FALSE]
  by_combination <- lapply(levels(combination), function(k) rowMeans(cells[, combination == k, drop = FALSE]))
  wide <- do.call(cbind, by_combination)
  group <- if (is.na(setting("group is a factor"))) character(0) else {
    factor(participants$group[match(rownames(cells), participants$participant)])
  }
  sizes <- vapply(factors, function(name) nlevels(ratings[[name]]), 0L)
  for (inside in seq_len(2^length(factors)) - 1) {
    chosen <- bitwAnd(inside, 2^(seq_along(factors) - 1)) > 0
    contrasts <- matrix(1)
    for (i in seq_along(factors)) {
      own <- if (chosen[i]) contr.helmert(sizes[i]) else matrix(1, sizes[i], 1)
      contrasts <- kronecker(contrasts, sweep(own, 2, sqrt(colSums(own^2)), "/"))
    }
    for (of_group in if (length(group) > 0) c(FALSE, TRUE) else FALSE) {
      name <- paste(c(factors[chosen], if (of_group) "group"), collapse = ":")
      if (name == "") next
      found <- spherical(wide %*% contrasts, group, of_group)
      print(c(effect = name, signif(found, 6)), quote = FALSE)
      value[paste0("factorial/", name, "/", names(found))] <- found
    }
  }
  margin <- as.numeric(setting("equivalence margin"))
  for (i in seq_along(factors)) {
    named_levels <- levels(ratings[[factors[i]]])
    for (a in seq_along(named_levels)) for (b in seq_along(named_levels)) if (b > a) {
      weights <- matrix(1)
      for (j in seq_along(factors)) {
        at <- seq_len(sizes[j])
        weights <- kronecker(weights, matrix(if (j == i) (at == a) - (at == b) else rep(1 / sizes[j], sizes[j])))
      }
      d <- as.vector(wide %*% weights)
      fit <- if (length(group) == 0) lm(d ~ 1) else lm(d ~ group, contrasts = list(group = "contr.sum"))
      own <- suppressWarnings(summary(fit))$coefficients[1, ]
      found <- c(difference = own[[1]], t = own[[3]], df = fit$df.residual, p = own[[4]],
                 p_tost = max(pt((own[[1]] + margin) / own[[2]], fit$df.residual, lower.tail = FALSE),
                              pt((own[[1]] - margin) / own[[2]], fit$df.residual)))
      pair <- paste0(in_id(factors[i]), "=", in_id(named_levels[a]), "|", in_id(named_levels[b]))
      print(c(contrast = pair, signif(found, 6)), quote = FALSE)
      value[paste0("factorial_contrast/", pair, "/", names(found))] <- found
    }
  }
}

#' ## VAF and mean rating
#'
#' The mean of each participant's ratings of a realization, then the mean over
#' participants; Pearson's correlation with the VAF over the realizations, and its exact
#' permutation test.

# The exact permutation test goes through all orders of up to eight realizations.
correlated <- function(x, y) {
  orders <- function(x) {
    if (length(x) < 2) return(list(x))
    do.call(c, lapply(seq_along(x), function(i) lapply(orders(x[-i]), function(o) c(x[i], o))))
  }
  p <- NA
  if (length(x) <= 8) {
    x <- x - mean(x)
    y <- y - mean(y)
    sums <- abs(vapply(orders(seq_along(y)), function(o) sum(x * y[o]), 0))
    p <- mean(sums >= abs(sum(x * y)) - 1e-10 * sqrt(sum(x^2) * sum(y^2)))
  }
  list(r = cor(x, y), p_exact = p)
}
if (has_ratings) value["corr/n_models"] <- 0
with_vaf <- if (has_ratings) tested[!is.na(tested$vaf), ] else data.frame()
if (nrow(with_vaf) > 0) {
  with_vaf$model <- droplevels(with_vaf$model)
  cells <- tapply(with_vaf$rating, list(with_vaf$participant, with_vaf$model), mean)
  means <- colMeans(cells, na.rm = TRUE)
  vaf <- tapply(with_vaf$vaf, with_vaf$model, function(v) v[1])
  value["corr/n_models"] <- length(means)
}
if (nrow(with_vaf) > 0 && length(means) > 2 && sd(vaf) > 0 && sd(means) > 0) {
  pearson <- cor.test(vaf, means)
  print(pearson)
  value["corr/pearson/r"] <- unname(pearson$estimate)
  value["corr/pearson/p_t"] <- pearson$p.value
  value["corr/pearson/p_exact_two_sided"] <- correlated(vaf, means)$p_exact
}

#' ## Linear mixed model
#'
#' Random intercepts of participants and of realizations, so that the slope holds for
#' other realizations, too. The VAF is standardized for the fit.

suppressPackageStartupMessages({
  library(lme4)
  library(lmerTest)
  library(ordinal)
})
control <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhobeg = 0.2, rhoend = 1e-9),
                       check.conv.singular = "ignore")
enough <- nrow(with_vaf) > 0 && length(means) > 2 && sd(vaf) > 0 &&
  nlevels(droplevels(with_vaf$participant)) > 1
if (enough) {
  with_vaf$vaf_z <- as.vector(scale(with_vaf$vaf))
  unit <- sd(with_vaf$vaf)
  several <- any(table(with_vaf$participant, with_vaf$model) > 1)
  formula <- if (several) {
    rating ~ vaf_z + (1 | participant) + (1 | model) + (1 | participant:model)
  } else {
    rating ~ vaf_z + (1 | participant) + (1 | model)
  }
  linear <- lmer(formula, data = with_vaf, control = control)
  print(summary(linear))
  slope <- coef(summary(linear))["vaf_z", ]
  variance <- as.data.frame(VarCorr(linear))
  of <- function(group) variance$vcov[variance$grp == group]
  value["lmm_vaf_crossed/slope"] <- slope[["Estimate"]] / unit
  value["lmm_vaf_crossed/slope_se"] <- slope[["Std. Error"]] / unit
  value["lmm_vaf_crossed/slope_satterthwaite_df"] <- slope[["df"]]
  value["lmm_vaf_crossed/slope_satterthwaite_p"] <- slope[["Pr(>|t|)"]]
  value["lmm_vaf_crossed/var_subject"] <- of("participant")
  value["lmm_vaf_crossed/var_model"] <- of("model")
  value["lmm_vaf_crossed/sigma2"] <- of("Residual")
}

#' ## Generalized mixed models of measured outcomes
#'
#' Counts (Poisson) and successes in trials (binomial), with random intercepts of participants, of
#' their cells and, with several factors, of participants at the levels of each and of two of three;
#' each effect is tested by the ratio of the likelihoods with and without it, with contrasts that sum to
#' zero. The modes are found more precisely than by default, and a search can stop at a standard
#' deviation of 0: the best of three starts counts.

precise <- glmerControl(optimizer = "bobyqa", optCtrl = list(rhobeg = 0.2, rhoend = 1e-8, maxfun = 1e5),
                        tolPwrss = 1e-12, check.conv.singular = "ignore", check.conv.grad = "ignore",
                        check.conv.hess = "ignore", calc.derivs = FALSE)
generalized <- function(id) {
  d <- tested[!is.na(tested[[setting(paste("column of", id))]]), ]
  d$number <- d[[setting(paste("column of", id))]]
  of <- as.numeric(setting(paste("trials of", id)))
  by <- if (length(factors) > 0) d[factors] else d["model"]
  if (length(factors) > 0 && !is.na(setting("group is a factor"))) {
    by$group <- factor(participants$group[match(d$participant, participants$participant)])
    d <- d[!is.na(by$group), ]
    by <- by[!is.na(by$group), , drop = FALSE]
  }
  names_of <- names(by)
  names(by) <- paste0("f", seq_along(by))
  by[] <- lapply(by, droplevels)
  terms <- terms(as.formula(paste("~", paste(names(by), collapse = " * "))))
  x <- model.matrix(terms, by, contrasts.arg = lapply(by, function(f) "contr.sum"))
  d[names(by)] <- by
  within <- names(by)[seq_along(factors)]
  of_size <- function(size) combn(within, size, paste, collapse = ":")
  shared <- if (length(within) > 1) {
    most <- if (prod(sapply(by[within], nlevels)) > 12) 1 else length(within) - 1
    unlist(lapply(seq_len(most), of_size))
  }
  repeats <- anyDuplicated(d[c("participant", "model")]) > 0
  cells <- is.na(of) || of > 1 || repeats
  left <- if (is.na(of)) "number" else "cbind(number, of - number)"
  random <- c("participant", if (cells) "participant:model", if (length(shared) > 0) paste0("participant:", shared))
  right <- paste("0 + x +", paste0("(1 | ", random, ")", collapse = " + "))
  d$of <- of
  fitted <- function(columns) {
    d$x <- x[, columns, drop = FALSE]
    found <- lapply(c(0.3, 1, 0.05), function(theta) {
      glmer(as.formula(paste(left, "~", right)), data = d, nAGQ = if (length(random) > 1) 1 else 25,
            family = if (is.na(of)) poisson else binomial, control = precise, start = list(theta = rep(theta, length(random))))
    })
    found[[which.max(sapply(found, logLik))]]
  }
  full <- fitted(seq_len(ncol(x)))
  print(summary(full))
  for (k in seq_along(labels <- attr(terms, "term.labels"))) {
    own <- attr(x, "assign") == k
    chi2 <- max(0, 2 * as.numeric(logLik(full) - logLik(fitted(which(!own)))))
    places <- as.integer(sub("f", "", strsplit(labels[k], ":")[[1]]))
    name <- if (length(factors) > 0) paste0("effect/", paste(names_of[places], collapse = ":")) else "differ"
    found <- c(chi2 = chi2, df = sum(own), p = pchisq(chi2, sum(own), lower.tail = FALSE))
    value[paste0("outcomes/", id, "/model/", name, "/", names(found))] <<- found
  }
}
for (id in if (has_ratings) kept("modeled")) {
  tryCatch(generalized(id), error = function(e) cat(id, ": no model, ", conditionMessage(e), "\n", sep = ""))
}

#' ## Ordinal mixed model
#'
#' The ratings as ordered categories. `clmm` needs the standardized VAF: with the raw one
#' its standard errors are off by up to 1 %, and at least three participants and categories.

three <- enough && nlevels(droplevels(with_vaf$participant)) > 2 &&
  length(unique(with_vaf$rating)) > 2
if (three && all(with_vaf$rating == round(with_vaf$rating))) {
  with_vaf$ordered <- ordered(with_vaf$rating)
  ordinal_fit <- clmm(ordered ~ vaf_z + (1 | participant) + (1 | model), data = with_vaf)
  without <- clmm(ordered ~ 1 + (1 | participant) + (1 | model), data = with_vaf)
  print(summary(ordinal_fit))
  found <- coef(summary(ordinal_fit))["vaf_z", ]
  value["clmm_vaf_crossed/beta/vaf"] <- found[["Estimate"]] / unit
  value["clmm_vaf_crossed/se/vaf"] <- found[["Std. Error"]] / unit
  # With as many participants as realizations ordinal 2022.11-16 prints their names in
  # the wrong order; those of ranef() are right.
  deviation <- vapply(VarCorr(ordinal_fit), function(v) attr(v, "stddev"), 0)
  names(deviation) <- names(ranef(ordinal_fit))
  value["clmm_vaf_crossed/sd_subject"] <- deviation[["participant"]]
  value["clmm_vaf_crossed/sd_model"] <- deviation[["model"]]
  value["clmm_vaf_crossed/loglik"] <- as.numeric(logLik(ordinal_fit))
  value["clmm_vaf_crossed/lrt_chi2"] <-
    2 * as.numeric(logLik(ordinal_fit) - logLik(without))
}

#' ## Groups, sessions and mixed models of parts
#'
#' A part gives a number of each participant, condition and session. Groups are compared by
#' Welch's tests over what all of them have, and by the interaction of group and condition;
#' sessions by a linear mixed model and by intraclass correlations. Where levels have ratios, all
#' of this is about natural logarithms.

participant_group <- function(who) {
  own <- match(who, as.character(ratings$participant))
  if (is.null(ratings$group)) rep(NA_character_, length(who)) else as.character(ratings$group)[own]
}
sorted <- function(names) sort(unique(names), method = "radix")
tried <- function(test) tryCatch(test, error = function(why) NULL)
# The test of y ~ condition + (1 | participant), as the numbers of `group`.
mixed_test <- function(put, group, data) {
  if (any(!is.finite(data$y)) || length(unique(data$condition)) < 2) return(invisible())
  formula <- y ~ condition + (1 | participant)
  model <- tried(lmer(formula, data = data, control = control))
  if (is.null(model)) return(invisible())
  # The deviance is flat where the variance of the participants is 0, and the search stops
  # beside it, with other degrees of freedom. At 0 the model is that of lm.
  deviance_at <- lme4::lmer(formula, data = data, control = control, devFunOnly = TRUE)
  if (deviance_at(0) <= deviance_at(getME(model, "theta")) + 1e-9) {
    table <- anova(lm(y ~ condition, data = data))
    found <- c(F = table[["F value"]][1], df1 = table$Df[1], df2 = table$Df[2],
               p = table[["Pr(>F)"]][1])
  } else {
    table <- tried(anova(model, type = 3, ddf = "Satterthwaite"))
    if (is.null(table)) return(invisible())
    found <- c(F = table[["F value"]], df1 = table$NumDF, df2 = table$DenDF,
               p = table[["Pr(>F)"]])
  }
  print(table)
  for (what in names(found)) put(paste0(group, "/", what), found[[what]])
}
of_part <- function(part) function(what, number) value[paste0(part, ":", what)] <<- number
# Each participant's mean of `value` by condition, and by session if the part has several.
means_of <- function(part, data) {
  data <- data.frame(participant = as.character(data$participant),
                     condition = as.character(data$condition), value = data$value,
                     session = if (length(kept(paste("session", part))) > 1)
                       as.character(data$session_id) else rep("", nrow(data)))
  data <- aggregate(value ~ participant + condition + session, data = data, FUN = mean)
  data$group <- participant_group(data$participant)
  data
}

# The interaction of the group and what the columns of `y` are, as the numbers of `id`.
interaction_of <- function(put, id, y, group) {
  k <- ncol(y)
  fit <- lm(y ~ group)
  test <- tried(anova(fit, lm(y ~ 1), X = ~1, test = "Spherical"))
  if (is.null(test)) return(invisible())
  print(test)
  contrasts <- contr.helmert(k)
  contrasts <- sweep(contrasts, 2, sqrt(colSums(contrasts^2)), "/")
  own <- crossprod(residuals(fit) %*% contrasts)
  columns <- c(F = "F", df1 = "num Df", df2 = "den Df", p = "Pr(>F)", p_gg = "G-G Pr")
  for (what in names(columns)) put(paste0(id, "/", what), test[2, columns[[what]]])
  put(paste0(id, "/eps_gg"), sum(diag(own))^2 / ((k - 1) * sum(own^2)))
}

# Whether the groups change alike from session to session, over the conditions that all sessions have.
compare_courses <- function(put, all, group, sessions, ratios) {
  of_condition <- sub("\r.*", "", colnames(all))
  of_session <- sub(".*\r", "", colnames(all))
  sessions <- sessions[sessions %in% of_session]
  shared <- Reduce(intersect, lapply(sessions, function(s) of_condition[of_session == s]))
  if (length(sessions) < 2 || length(shared) == 0) return(invisible())
  y <- vapply(sessions, function(s) {
    rowMeans(all[, of_session == s & of_condition %in% shared, drop = FALSE])
  }, numeric(nrow(all)))
  interaction_of(put, "groups_sessions", y, group)
  change <- y[, length(sessions)] - y[, 1]
  groups <- sorted(group)
  shown <- if (ratios) exp else identity
  for (i in seq_along(groups)) for (j in seq_along(groups)) if (j > i) {
    test <- tried(t.test(change[group == groups[i]], change[group == groups[j]], var.equal = TRUE))
    if (is.null(test)) next
    pair <- paste0("groups_sessions/", groups[i], "|", groups[j])
    put(paste0(pair, if (ratios) "/ratio" else "/difference"), shown(test$estimate[[1]] - test$estimate[[2]]))
    put(paste0(pair, "/t"), test$statistic[[1]])
    put(paste0(pair, "/df"), test$parameter[[1]])
    put(paste0(pair, "/p"), test$p.value)
  }
}

compare_groups <- function(put, cells, ratios, by_condition, sessions) {
  cells <- cells[!is.na(cells$group), ]
  groups <- sorted(cells$group)
  if (length(groups) < 2) return(invisible())
  where <- paste(cells$condition, cells$session, sep = "\r")
  common <- sorted(Reduce(intersect, lapply(groups, function(g) where[cells$group == g])))
  all <- tapply(cells$value, list(cells$participant, factor(where, levels = common)), mean)
  all <- all[rowSums(is.na(all)) == 0, , drop = FALSE]
  if (length(common) == 0 || nrow(all) == 0) return(invisible())
  group <- participant_group(rownames(all))
  shown <- if (ratios) exp else identity
  if (!by_condition) {
    x <- rowMeans(all)
    test <- tried(oneway.test(x ~ group))
    if (!is.null(test)) {
      print(test)
      found <- c(F = test$statistic[[1]], df1 = test$parameter[[1]], df2 = test$parameter[[2]], p = test$p.value)
      for (what in names(found)) put(paste0("groups/", what), found[[what]])
    }
    for (i in seq_along(groups)) {
      own <- x[group == groups[i]]
      put(paste0("groups/", groups[i], if (ratios) "/geometric_mean" else "/mean"), shown(mean(own)))
      put(paste0("groups/", groups[i], if (ratios) "/geometric_sd" else "/sd"), shown(sd(own)))
      for (j in seq_along(groups)) if (j > i) {
        test <- tried(t.test(own, x[group == groups[j]]))
        if (is.null(test)) next
        pair <- paste0("groups/", groups[i], "|", groups[j])
        put(paste0(pair, if (ratios) "/ratio" else "/difference"),
            shown(test$estimate[[1]] - test$estimate[[2]]))
        put(paste0(pair, "/t"), test$statistic[[1]])
        put(paste0(pair, "/df"), test$parameter[[1]])
        put(paste0(pair, "/p"), test$p.value)
      }
    }
  }
  if (nrow(all) <= length(groups) || length(unique(group)) < length(groups)) return(invisible())
  if (!by_condition) compare_courses(put, all, group, sessions, ratios)
  of_column <- sub("\r.*", "", colnames(all))
  conditions <- sorted(of_column)
  if (length(conditions) < 2) return(invisible())
  y <- vapply(conditions, function(c) rowMeans(all[, of_column == c, drop = FALSE]), numeric(nrow(all)))
  interaction_of(put, "groups_conditions", y, group)
}

compare_sessions <- function(put, cells, sessions) {
  # Of each participant what all of the participant's sessions have.
  level <- do.call(rbind, lapply(split(cells, cells$participant), function(own) {
    own <- own[own$condition %in% Reduce(intersect, split(own$condition, own$session)), ]
    if (nrow(own) > 0) aggregate(value ~ participant + session, data = own, FUN = mean)
  }))
  mixed_test(put, "sessions", data.frame(y = level$value, condition = level$session,
                                         participant = level$participant))
  table <- tapply(level$value, list(level$participant, factor(level$session, levels = sessions)), mean)
  table <- table[rowSums(is.na(table)) == 0, , drop = FALSE]
  n <- nrow(table)
  k <- ncol(table)
  if (n < 2) return(invisible())
  whole <- sum((table - mean(table))^2)
  rows <- k * sum((rowMeans(table) - mean(table))^2) / (n - 1)
  columns <- n * sum((colMeans(table) - mean(table))^2) / (k - 1)
  error <- whole / (n - 1) / (k - 1) - rows / (k - 1) - columns / (n - 1)
  put("retest/icc_agreement", (rows - error) / (rows + (k - 1) * error + k * (columns - error) / n))
  put("retest/icc_consistency", (rows - error) / (rows + (k - 1) * error))
  put("retest/sem", sqrt(max(error, 0)))
}

again <- function(part, cells, ratios = FALSE, by_condition = FALSE) {
  if (ratios) cells$value <- suppressWarnings(log(cells$value))
  if (nrow(cells) == 0 || any(!is.finite(cells$value))) return(invisible())
  put <- of_part(part)
  sessions <- kept(paste("session", part))
  compare_groups(put, cells, ratios, by_condition, sessions)
  if (length(sessions) > 1 && !by_condition) compare_sessions(put, cells, sessions)
}

# The answers of a part that count, to its own question.
answers_of <- function(kind, part) {
  answers <- ratings[ratings$included & ratings$part == part, ]
  answers$value <- answers[[setting(paste(kind, part))]]
  answers[!is.na(answers$value), ]
}

#' ## Ratings of groups and sessions

for (part in kept("rating")) {
  rated <- answers_of("rating", part)
  repeats <- realizations$id[!is.na(realizations$duplicate_of)]
  rated <- rated[rated$role == "test" & !(rated$model %in% repeats), ]
  if (nrow(rated) == 0) next
  rated$condition <- rated$model
  again(part, means_of(part, rated))
}

#' ## Magnitude estimation
#'
#' Logarithms after modulus equalisation: a participant's mean of each realization or level, less
#' the participant's mean over them, plus the mean of all participants. Of levels the power law;
#' realizations are compared by a linear mixed model and with VAF.

for (part in kept("magnitude")) {
  given <- answers_of("magnitude", part)
  given <- given[given$value > 0, ]
  if (nrow(given) == 0) next
  put <- of_part(part)
  levels <- setting(paste("estimates", part)) == "levels"
  original <- realizations$duplicate_of[match(given$model, realizations$id)]
  given$condition <- if (levels) given$level else
    ifelse(is.na(original), as.character(given$model), as.character(original))
  given$log <- log10(given$value)
  cells <- tapply(given$log, list(as.character(given$participant), given$condition), mean)
  own <- rowMeans(cells, na.rm = TRUE)
  means <- colMeans(cells - own + mean(own), na.rm = TRUE)
  if (levels) {
    x <- log10(as.numeric(names(means)))
    line <- function(y) {
      use <- is.finite(x) & !is.na(y)
      if (sum(use) > 1) unname(coef(lm(y[use] ~ x[use]))) else c(NA, NA)
    }
    put("magnitude/exponent", line(means)[2])
    put("magnitude/log10_coefficient", line(means)[1])
    next
  }
  for (model in names(means)) put(paste0("magnitude/realization/", model, "/geometric_mean"), 10^means[[model]])
  long <- as.data.frame(as.table(cells), stringsAsFactors = FALSE)
  names(long) <- c("participant", "condition", "value")
  long <- long[!is.na(long$value), ]
  long$value <- long$value * log(10)
  mixed_test(put, "magnitude_mixed", transform(long, y = value))
  tests <- realizations$id[realizations$role == "test" & !is.na(realizations$vaf)]
  models <- intersect(sorted(names(means)), as.character(tests))
  vaf <- realizations$vaf[match(models, realizations$id)]
  if (length(models) > 2 && sd(vaf) > 0 && sd(means[models]) > 0) {
    found <- correlated(vaf, means[models])
    put("magnitude/vaf/pearson/r", found$r)
    put("magnitude/vaf/pearson/p_exact_two_sided", found$p_exact)
  }
  long$group <- participant_group(long$participant)
  long$session <- ""
  again(part, long, by_condition = TRUE)
}

#' ## Ratings beside a reference
#'
#' After ITU-R BS.1534-3 a participant is left out who rates the hidden reference below 90, or the
#' mid anchor above 90, in more than 15 % of the trials.

for (part in kept("mushra")) {
  rated <- answers_of("mushra", part)
  if (nrow(rated) == 0) next
  put <- of_part(part)
  who <- as.character(rated$participant)
  broken <- function(wrong, role) {
    own <- rated$role == role
    if (!any(own)) return(character(0))
    share <- tapply(wrong[own], who[own], mean)
    names(share)[share * 100 > 15 + 1e-9]
  }
  screened <- c(broken(rated$value < 90, "hidden-reference"), broken(rated$value > 90, "mid-anchor"))
  if (length(screened) > 0) cat("left out: ", paste(sorted(screened), collapse = ", "), "\n", sep = "")
  rated <- rated[!(who %in% screened), ]
  for (model in unique(as.character(rated$model))) {
    own <- rated[rated$model == model, ]
    put(paste0("mushra/", model, "/median"), median(own$value))
    put(paste0("mushra/", model, "/mean"),
        mean(tapply(own$value, as.character(own$participant), mean)))
  }
}

#' ## Identification
#'
#' The confusion matrix of all participants has the labels that were right as rows and those that were
#' given as columns. Its information transfer is less its bias for fixed numbers of presentations (after
#' Miller 1955), with an interval on the logarithm of what is lost; similarities and biases of labels are
#' those of Luce's choice model, which is a log-linear model of rows and of pairs of cells, after
#' 1/labels was added to each cell. Participants are compared with guesses by a t test, whose standard
#' error is at least half of that of guesses.

entropy <- function(counts) {
  p <- counts[counts > 0] / sum(counts)
  -sum(p * log2(p))
}
corrected_bits <- function(counts) {
  elsewhere <- (1 - counts / rowSums(counts)) * (1 - t(t(counts) / colSums(counts)))
  bias <- sum(elsewhere[counts > 0]) / (2 * sum(counts) * log(2))
  entropy(rowSums(counts)) + entropy(colSums(counts)) - entropy(counts) - bias
}
biased_choice <- function(counts) {
  counts <- counts + 1 / nrow(counts)
  row <- factor(as.vector(row(counts)))
  pair <- factor(paste(pmin(row(counts), col(counts)), pmax(row(counts), col(counts))))
  fit <- suppressWarnings(glm(as.vector(counts) ~ row + pair, family = poisson(),
                              control = list(epsilon = 1e-14, maxit = 100)))
  fitted <- matrix(fitted(fit), nrow(counts))
  weight <- sqrt(fitted[1, ] * diag(fitted) / (fitted[, 1] * fitted[1, 1]))
  list(similarity = sqrt(fitted * t(fitted) / outer(diag(fitted), diag(fitted))),
       bias = weight / sum(weight))
}
# A name as part of an identifier.
escaped <- function(name) {
  for (mark in c("%", "/", "|")) {
    name <- gsub(mark, sprintf("%%%02X", utf8ToInt(mark)), name, fixed = TRUE)
  }
  name
}

for (part in kept("identification")) {
  put <- of_part(part)
  question <- setting(paste("identification", part))
  # Of an answer that was corrected after the right label was told, the first one counts.
  given <- as.character(ratings[[question]])
  first <- ratings[["answer_before_feedback"]]
  if (!is.null(first)) given <- ifelse(is.na(first), given, first)
  here <- ratings$included & ratings$part == part & !is.na(given)
  named <- ratings[here, ]
  if (nrow(named) == 0) next
  names <- labels$value[labels$table == "ratings" & labels$column == question]
  named$right <- factor(settings$value[match(paste("label", part, named$model), settings$key)], levels = names)
  named$given <- factor(given[here], levels = names)
  named$value <- (named$right == named$given) + 0
  original <- realizations$duplicate_of[match(named$model, realizations$id)]
  named$felt <- ifelse(is.na(original), as.character(named$model), as.character(original))
  named$participant <- as.character(named$participant)
  matrix_of <- function(rows) unclass(table(rows$right, rows$given))
  own <- lapply(split(named, named$participant), matrix_of)
  counts <- Reduce(`+`, own)
  print(counts)
  guessed <- function(m) sum(rowSums(m) * colSums(m)) / sum(m)^2
  put("identification/n", sum(counts))
  put("identification/correct", sum(diag(counts)) / sum(counts))
  put("identification/by_guessing", guessed(counts))
  for (model in sorted(named$felt)) {
    rows <- named[named$felt == model, ]
    put(paste0("identification/realization/", model, "/n"), nrow(rows))
    put(paste0("identification/realization/", model, "/correct"), mean(rows$value))
  }
  bits <- corrected_bits(counts)
  stimulus <- entropy(rowSums(counts))
  put("identification/information/corrected", bits)
  put("identification/information/transmitted", stimulus + entropy(colSums(counts)) - entropy(counts))
  put("identification/information/stimulus", stimulus)
  put("identification/information/items", 2^max(bits, 0))
  n <- length(own)
  if (n > 1) {
    lost <- function(m) entropy(rowSums(m)) - corrected_bits(m)
    left <- sapply(seq_len(n), function(i) lost(Reduce(`+`, own[-i])))
    se <- sqrt((n - 1) / n * sum((left - mean(left))^2))
    # Participants who are alike have no interval.
    if (se > 1e-10) {
      all_lost <- min(lost(counts), stimulus)
      half <- qt(0.975, n - 1) * se / all_lost
      put("identification/information/corrected_ci95_lo", max(stimulus - all_lost * exp(half), 0))
      put("identification/information/corrected_ci95_hi", max(stimulus - all_lost * exp(-half), 0))
    }
  }
  # Guesses of a single answer have no variance.
  several <- own[sapply(own, sum) > 1]
  n <- length(several)
  if (n < length(own)) cat("Participants with a single answer are left out of the test against guesses.\n")
  if (n > 1) {
    above <- sapply(several, function(m) sum(diag(m)) / sum(m) - guessed(m))
    guesses <- sapply(several, function(m) {
      all <- sum(m)
      product <- rowSums(m) * colSums(m)
      alone <- sum(product * (all - rowSums(m)) * (all - colSums(m)))
      (alone + sum(product)^2 - sum(product^2)) / (all^4 * (all - 1))
    })
    se <- sqrt(max(var(above) / n, sum(guesses) / (4 * n^2)))
    test <- c(mean = mean(above), se = se, t = mean(above) / se, df = n - 1,
              p = 2 * pt(-abs(mean(above) / se), n - 1))
    # Not of participants who each always gave the same label.
    if (se > 0) for (what in names(test)) put(paste0("identification/above_guessing/", what), test[[what]])
  }
  for (i in seq_along(names)) for (j in seq_along(names)) if (i < j) {
    rate <- function(k, n) (k + 0.5) / (n + 1)
    hit <- rate(counts[i, i], counts[i, i] + counts[i, j])
    false_alarm <- rate(counts[j, i], counts[j, i] + counts[j, j])
    both <- paste(escaped(sort(names[c(i, j)], method = "radix")), collapse = "|")
    put(paste0("identification/pair/", both, "/d"), qnorm(hit) - qnorm(false_alarm))
  }
  if (all(rowSums(counts) > 0)) {
    model <- biased_choice(counts)
    for (i in seq_along(names)) {
      put(paste0("identification/label/", escaped(names[i]), "/bias"), model$bias[i])
      for (j in seq_along(names)) if (i < j) {
        both <- paste(escaped(sort(names[c(i, j)], method = "radix")), collapse = "|")
        put(paste0("identification/pair/", both, "/similarity"), model$similarity[i, j])
      }
    }
  }
  named$condition <- "correct"
  again(part, means_of(part, named))
}

#' ## Similarity
#'
#' Each participant's ratings of a pair are averaged, over both orders, and divided by the mean of
#' that participant's pairs, and where some did not rate every pair by a factor of the participant's; their mean
#' over participants is scaled. What is computed here again are these
#' means, the agreement of the participants (mean correlation; Kendall's W), the asymmetry of the two orders, and
#' the share of classical scaling (`cmdscale`). Ordinal maps have random starts and are in `values.json` only.

for (part in kept("similarity")) {
  put <- of_part(part)
  answers <- ratings[ratings$included & ratings$part == part, ]
  answers$value <- answers[[setting(paste("similarity", part))]]
  answers <- answers[!is.na(answers$value), ]
  felt <- read_table("intervals")
  key <- function(data) paste(data$participant, data$session, data$trial, data$attempt, sep = "\r")
  item <- function(number) {
    own <- felt[felt$interval == number, ]
    as.character(own$model)[match(key(answers), key(own))]
  }
  answers$first <- item(1)
  answers$second <- item(2)
  answers$who <- as.character(answers$participant)
  if (nrow(answers) == 0) next
  items <- sorted(c(answers$first, answers$second))
  same <- answers[answers$first == answers$second, ]
  rated <- answers[answers$first != answers$second, ]
  if (nrow(rated) == 0) next
  people <- sorted(rated$who)
  ends <- combn(items, 2)
  pair <- paste(ends[1, ], ends[2, ], sep = "|")
  # Participants by pairs: means of one order, of the other, and of both.
  order_mean <- function(a, b) sapply(seq_along(pair), function(i) sapply(people, function(who) {
    own <- rated$value[rated$who == who & rated$first == a[i] & rated$second == b[i]]
    if (length(own) > 0) mean(own) else NA
  }))
  as_table <- function(x) matrix(x, nrow = length(people), dimnames = list(people, pair))
  one <- as_table(order_mean(ends[1, ], ends[2, ]))
  other <- as_table(order_mean(ends[2, ], ends[1, ]))
  both <- ifelse(is.na(one), other, ifelse(is.na(other), one, (one + other) / 2))
  own_mean <- rowMeans(both, na.rm = TRUE)
  known <- both[own_mean > 0, , drop = FALSE]
  unit <- known / rowMeans(known, na.rm = TRUE)
  # What they have in common: each participant has a factor, over the pairs that they rated.
  over_own <- function(x, values) as.vector((!is.na(x)) %*% ifelse(is.finite(values), values, 0))
  factors <- rep(1, nrow(unit))
  mean_unit <- colMeans(unit, na.rm = TRUE)
  for (round in seq_len(1000)) {
    found <- rowSums(unit, na.rm = TRUE) / over_own(unit, mean_unit)
    moved <- max(0, abs(found / factors - 1))
    factors <- found
    mean_unit <- colMeans(unit / factors, na.rm = TRUE)
    if (moved < 1e-12) break
  }
  points <- mean(rowSums(both, na.rm = TRUE) / over_own(both, mean_unit))
  print(round(colMeans(both, na.rm = TRUE), 2))
  put("similarity/n", nrow(rated))
  put("similarity/mean", mean(own_mean))
  put("similarity/n_participants", nrow(unit))
  for (i in seq_along(pair)) {
    id <- paste0("similarity/pair/", pair[i], "/")
    here <- both[!is.na(both[, i]), i]
    put(paste0(id, "n"), sum((rated$first == ends[1, i] & rated$second == ends[2, i]) |
                             (rated$first == ends[2, i] & rated$second == ends[1, i])))
    if (length(here) > 0) put(paste0(id, "mean"), mean(here))
    if (length(here) > 1) put(paste0(id, "sd"), sd(here))
    if (is.finite(mean_unit[i])) put(paste0(id, "rescaled"), mean_unit[i] * points)
  }
  if (nrow(unit) > 1) {
    correlations <- suppressWarnings(cor(t(unit), use = "pairwise.complete.obs"))
    put("similarity/agreement/mean_correlation", mean(correlations[lower.tri(correlations)], na.rm = TRUE))
    asked <- unit[, colSums(!is.na(unit)) > 0, drop = FALSE]
    whole <- asked[stats::complete.cases(asked), , drop = FALSE]
    if (nrow(whole) > 1) {
      ranks <- t(apply(round(whole, 10), 1, rank))
      m <- nrow(ranks)
      k <- ncol(ranks)
      ties <- sum(apply(ranks, 1, function(x) sum(table(x)^3 - table(x))))
      spread <- sum((colSums(ranks) - m * (k + 1) / 2)^2)
      put("similarity/agreement/kendall_w", 12 * spread / (m^2 * (k^3 - k) - m * ties))
    }
  }
  difference <- colMeans(one - other, na.rm = TRUE)
  if (any(is.finite(difference))) {
    put("similarity/order/rms", sqrt(mean(difference[is.finite(difference)]^2)))
  }
  if (nrow(same) > 0) {
    own <- tapply(same$value, same$who, mean)
    put("similarity/identical/n", nrow(same))
    put("similarity/identical/mean", mean(own))
    put("similarity/identical/share", mean(own) / mean(own_mean[names(own)], na.rm = TRUE))
  }
  if (length(items) > 3 && length(items) <= 30 && all(is.finite(mean_unit))) {
    full <- matrix(0, length(items), length(items))
    full[lower.tri(full)] <- mean_unit
    values <- cmdscale(as.dist(full), k = 1, eig = TRUE)$eig
    for (k in seq_len(min(3, (length(items) - 2) %/% 2))) {
      put(paste0("similarity/dimensions/", k, "/classical"), sum(pmax(values[1:k], 0)) / sum(abs(values)))
    }
  }
}

#' ## Rankings
#'
#' Ranks are those of one ranking, ties in the middle; the mean ranks of each participant have Kendall's W. Worths are those of
#' the model of Plackett and Luce with ties (Turner and others 2020), as a log-linear model: each ranking is a sequence of choices of
#' the set with the smallest rank from those that are left, and the logarithm of a set's weight is the mean of those of its
#' worths and, of a tie, a constant for its size. Where some items are above all others in every ranking, the likelihood has
#' a limit in place of a maximum, that of the choices within each such level. The logarithms of the worths of a level sum to zero.

for (part in kept("ranking")) {
  put <- of_part(part)
  answers <- ratings[ratings$included & ratings$part == part, ]
  first <- setting(paste("ranking", part))
  felt <- read_table("intervals")
  key <- function(data) paste(data$participant, data$session, data$trial, data$attempt, sep = "\r")
  felt <- felt[key(felt) %in% key(answers), ]
  if (nrow(felt) == 0) next
  items <- sorted(as.character(felt$model))
  # Rankings by items.
  ranks <- matrix(NA, nrow(answers), length(items), dimnames = list(NULL, items))
  for (interval in seq_len(max(felt$interval))) {
    column <- if (interval == 1) first else paste0(first, "-", interval)
    own <- felt[felt$interval == interval, ]
    model <- as.character(own$model)[match(key(answers), key(own))]
    for (i in which(!is.na(model))) ranks[i, model[i]] <- answers[[column]][i]
  }
  keep <- rowSums(!is.na(ranks)) > 1
  ranks <- ranks[keep, , drop = FALSE]
  who <- as.character(answers$participant)[keep]
  if (nrow(ranks) == 0) next
  people <- sorted(who)
  put("ranking/n", nrow(ranks))
  put("ranking/n_participants", length(people))
  whole <- stats::complete.cases(ranks)
  means <- t(sapply(intersect(people, who[whole]), function(one) {
    colMeans(t(apply(ranks[whole & who == one, , drop = FALSE], 1, rank)))
  }))
  put("ranking/agreement/n", nrow(means))
  if (nrow(means) > 1 && length(items) > 1) {
    again_ranked <- t(apply(round(means, 10), 1, rank))
    m <- nrow(again_ranked)
    k <- ncol(again_ranked)
    ties <- sum(apply(again_ranked, 1, function(x) sum(table(x)^3 - table(x))))
    spread <- sum((colSums(again_ranked) - m * (k + 1) / 2)^2)
    put("ranking/agreement/df", k - 1)
    if (m * (k^3 - k) > ties) {
      w <- 12 * spread / (m^2 * (k^3 - k) - m * ties)
      put("ranking/agreement/w", w)
      put("ranking/agreement/chi2", m * (k - 1) * w)
      put("ranking/agreement/p_chi2", pchisq(m * (k - 1) * w, k - 1, lower.tail = FALSE))
    }
  }
  best <- apply(ranks, 1, min, na.rm = TRUE)
  for (item in items) {
    id <- paste0("ranking/realization/", item, "/")
    here <- !is.na(ranks[, item])
    put(paste0(id, "n"), sum(here))
    if (nrow(means) > 0) put(paste0(id, "mean_rank"), mean(means[, item]))
    if (nrow(means) > 1) put(paste0(id, "sd"), sd(means[, item]))
    if (any(here)) put(paste0(id, "first"), mean(ranks[here, item] == best[here]))
  }
  for (i in seq_along(items)) for (j in seq_along(items)) if (j > i) {
    id <- paste0("ranking/pair/", items[i], "|", items[j], "/")
    both <- !is.na(ranks[, i]) & !is.na(ranks[, j])
    put(paste0(id, "n"), sum(both))
    if (any(both)) {
      put(paste0(id, "above"), mean(ranks[both, i] < ranks[both, j]))
      put(paste0(id, "tied"), mean(ranks[both, i] == ranks[both, j]))
    }
  }
  # Whether an item was above another or had the same rank, directly or by way of others.
  above <- diag(length(items)) > 0
  for (i in seq_along(items)) for (j in seq_along(items)) {
    above[i, j] <- above[i, j] || any(ranks[, i] <= ranks[, j], na.rm = TRUE)
  }
  for (via in seq_along(items)) above <- above | outer(above[, via], above[via, ])
  if (!all(above | t(above))) {
    cat("part ", part, ": the worths have no estimate\n", sep = "")
    next
  }
  level <- match(rowSums(above), sort(unique(rowSums(above)), decreasing = TRUE))
  alone <- table(level)[level] == 1
  choices <- unlist(lapply(seq_len(nrow(ranks)), function(row) {
    own <- ranks[row, ]
    unlist(lapply(seq_len(max(level)), function(one) {
      inside <- level == one & !is.na(own)
      places <- sort(unique(own[inside]))
      lapply(places, function(place) list(taken = which(inside & own == place), left = which(inside & own >= place)))
    }), recursive = FALSE)
  }), recursive = FALSE)
  choices <- Filter(function(choice) length(choice$left) > 1, choices)
  if (length(choices) == 0) {
    # Each item is a level.
    for (i in seq_along(items)) {
      put(paste0("ranking/realization/", items[i], "/level"), level[i])
      put(paste0("ranking/realization/", items[i], "/worth"), (level[i] == 1) + 0)
    }
    next
  }
  sizes <- setdiff(sort(unique(lengths(lapply(choices, function(choice) choice$taken)))), 1)
  # The logarithms of the worths from the parameters: within a level the last one is minus the sum of the others.
  contrast <- do.call(cbind, lapply(seq_len(max(level)), function(one) {
    inside <- which(level == one)
    sapply(inside[-length(inside)], function(item) {
      own <- replace(numeric(length(items)), item, 1)
      replace(own, inside[length(inside)], -1)
    })
  })[lengths(split(level, level)) > 1])
  free <- ncol(contrast)
  outcomes <- do.call(rbind, lapply(seq_along(choices), function(at) {
    left <- choices[[at]]$left
    sets <- unlist(lapply(intersect(c(1, sizes), seq_along(left)), function(size) {
      combn(length(left), size, function(some) list(unname(left[some])))
    }), recursive = FALSE)
    weights <- t(sapply(sets, function(set) {
      own <- tabulate(set, length(items)) / length(set)
      c(own %*% contrast, (sizes == length(set)) + 0)
    }))
    # With one column the sets are the columns.
    if (ncol(weights) != free + length(sizes)) weights <- t(weights)
    taken <- sapply(sets, function(set) setequal(set, choices[[at]]$taken))
    cbind(weights, taken + 0, at)
  }))
  own <- seq_len(free + length(sizes))
  stratum <- model.matrix(~ factor(outcomes[, ncol(outcomes)]) - 1)
  fit <- tryCatch(
    glm.fit(cbind(outcomes[, own, drop = FALSE], stratum), outcomes[, length(own) + 1], family = poisson(),
            control = list(epsilon = 1e-14, maxit = 100)),
    warning = function(why) NULL, error = function(why) NULL)
  if (is.null(fit) || !fit$converged) {
    cat("part ", part, ": the worths have no estimate\n", sep = "")
    next
  }
  covariance <- chol2inv(fit$qr$qr[seq_along(fit$coefficients), , drop = FALSE])
  covariance <- covariance[order(fit$qr$pivot), order(fit$qr$pivot)][own, own, drop = FALSE]
  estimate <- fit$coefficients[own]
  contrast <- cbind(contrast, matrix(0, length(items), length(sizes)))
  worth <- as.vector(contrast %*% estimate)
  spread <- contrast %*% covariance %*% t(contrast)
  print(data.frame(item = items, level = level, log_worth = worth, se = sqrt(diag(spread))))
  power <- ifelse(level == 1, exp(worth), 0)
  for (i in seq_along(items)) {
    id <- paste0("ranking/realization/", items[i], "/")
    if (max(level) > 1) put(paste0(id, "level"), level[i])
    put(paste0(id, "worth"), power[i] / sum(power))
    if (alone[i]) next
    put(paste0(id, "log_worth"), worth[i])
    put(paste0(id, "log_worth_se"), sqrt(spread[i, i]))
    for (j in seq_along(items)) if (j > i && level[i] == level[j]) {
      group <- paste0("ranking/pair/", items[i], "|", items[j])
      put(paste0(group, "/difference"), worth[i] - worth[j])
      put(paste0(group, "/se"), sqrt(spread[i, i] + spread[j, j] - 2 * spread[i, j]))
    }
  }
  for (size in seq_along(sizes)) {
    at <- free + size
    put(paste0("ranking/ties/", sizes[size], "/log_delta"), estimate[[at]])
    put(paste0("ranking/ties/", sizes[size], "/log_delta_se"), sqrt(covariance[at, at]))
  }
}

#' ## Adjustment
#'
#' A participant's point of subjective equality is the mean of the mean settings from below and from above. It is compared
#' with the standard, and both sides with each other, by t tests over participants. Settings scatter within participants and
#' sides; the interval of that, by the bootstrap, is in `values.json` only.

for (part in kept("adjustment")) {
  put <- of_part(part)
  answers <- ratings[ratings$included & ratings$part == part, ]
  answers$value <- answers[[setting(paste("adjustment", part))]]
  answers <- answers[!is.na(answers$value), ]
  if (nrow(answers) == 0) next
  felt <- read_table("intervals")
  felt <- felt[!is.na(felt$target) & felt$target, ]
  felt <- felt[order(felt$interval), ]
  key <- function(data) paste(data$participant, data$session, data$trial, data$attempt, sep = "\r")
  levels_of <- split(as.character(felt$model), key(felt))[key(answers)]
  side <- sapply(levels_of, function(own) setting(paste("start", part, own[1])))
  changes <- sapply(levels_of, function(own) sum(own[-1] != own[-length(own)]))
  who <- as.character(answers$participant)
  people <- sorted(who)
  of_side <- function(p, which) answers$value[who == p & side == which]
  mean_of <- function(which) sapply(people, function(p) {
    own <- of_side(p, which)
    if (length(own) > 0) mean(own) else NA
  })
  over_sides <- function(count) sapply(people, function(p) count(of_side(p, "below")) + count(of_side(p, "above")))
  below <- mean_of("below")
  above <- mean_of("above")
  pse <- ifelse(is.na(below), above, ifelse(is.na(above), below, (below + above) / 2))
  squares <- over_sides(function(own) if (length(own) > 0) sum((own - mean(own))^2) else 0)
  df <- over_sides(function(own) max(length(own) - 1, 0))
  print(round(cbind(below, above, pse, sd = sqrt(squares / df)), 3))
  put("adjustment/n", nrow(answers))
  put("adjustment/n_participants", length(people))
  put("adjustment/changes", mean(changes))
  put("adjustment/pse", mean(pse))
  for (p in people) {
    id <- paste0("adjustment/participant/", p, "/")
    put(paste0(id, "n"), sum(who == p))
    put(paste0(id, "pse"), pse[[p]])
    if (!is.na(below[[p]])) put(paste0(id, "ascending"), below[[p]])
    if (!is.na(above[[p]])) put(paste0(id, "descending"), above[[p]])
    if (df[[p]] > 0) put(paste0(id, "sd"), sqrt(squares[[p]] / df[[p]]))
  }
  interval <- function(id, x) {
    half <- qt(0.975, length(x) - 1) * sd(x) / sqrt(length(x))
    put(paste0(id, "_lo"), mean(x) - half)
    put(paste0(id, "_hi"), mean(x) + half)
  }
  tested <- function(id, x) {
    if (length(x) < 2) return(invisible())
    interval(paste0(id, "ci95"), x)
    put(paste0(id, "df"), length(x) - 1)
    # Participants who are alike have no test.
    if (max(x) - min(x) > 1e-10) {
      t <- mean(x) / (sd(x) / sqrt(length(x)))
      put(paste0(id, "t"), t)
      put(paste0(id, "p"), 2 * pt(-abs(t), length(x) - 1))
    }
  }
  if (length(pse) > 1) {
    interval("adjustment/pse_ci95", pse)
    put("adjustment/pse_sd", sd(pse))
  }
  standard <- as.numeric(setting(paste("standard", part)))
  if (is.finite(standard)) {
    put("adjustment/error/standard", standard)
    put("adjustment/error/mean", mean(pse - standard))
    if (standard > 0) put("adjustment/error/relative", mean(pse - standard) / standard)
    tested("adjustment/error/", pse - standard)
  }
  both <- !is.na(below) & !is.na(above)
  if (any(both)) {
    put("adjustment/start/ascending", mean(below[both]))
    put("adjustment/start/descending", mean(above[both]))
    put("adjustment/start/difference", mean((below - above)[both]))
    tested("adjustment/start/", (below - above)[both])
  }
  if (sum(df) > 0) {
    spread <- sqrt(sum(squares) / sum(df))
    put("adjustment/spread/sd", spread)
    put("adjustment/spread/df", sum(df))
    if (mean(pse) > 0) put("adjustment/spread/relative", spread / mean(pse))
  }
}

#' ## Pairs
#'
#' Abilities by maximum likelihood, as a log-linear model of the counts: the weight of the
#' first is its ability and half the effect of the order, that of the second likewise, and of a
#' tie half of both abilities and a constant (Bradley and Terry; Davidson). The abilities sum to
#' zero.

for (part in kept("pairs")) {
  answers <- ratings[ratings$included & ratings$part == part, ]
  answers$answer <- as.character(answers[[setting(paste("pairs", part))]])
  felt <- read_table("intervals")
  key <- function(data) paste(data$participant, data$session, data$trial, data$attempt, sep = "\r")
  item <- function(number) {
    own <- felt[felt$interval == number, ]
    as.character(own$model)[match(key(answers), key(own))]
  }
  answers$first <- item(1)
  answers$second <- item(2)
  ties <- setting(paste("ties", part)) == "ties" && any(answers$answer == "tie")
  won <- ifelse(answers$answer == "first", 1, ifelse(answers$answer == "tie", 0.5, 0))
  wins <- data.frame(participant = rep(as.character(answers$participant), 2),
                     condition = c(answers$first, answers$second), value = c(won, 1 - won), session = "")
  wins <- aggregate(value ~ participant + condition + session, data = wins, FUN = mean)
  wins$group <- participant_group(wins$participant)
  again(part, wins, by_condition = TRUE)
  if (!ties) answers <- answers[answers$answer != "tie", ]
  items <- sort(unique(c(answers$first, answers$second)), method = "radix")
  outcomes <- c("first", "second", if (ties) "tie")
  counts <- as.data.frame(table(pair = paste(answers$first, answers$second, sep = "\r"),
                                answer = factor(answers$answer, levels = outcomes)))
  names <- do.call(rbind, strsplit(as.character(counts$pair), "\r", fixed = TRUE))
  share <- cbind(ifelse(counts$answer == "first", 1, ifelse(counts$answer == "tie", 0.5, 0)),
                 ifelse(counts$answer == "second", 1, ifelse(counts$answer == "tie", 0.5, 0)))
  # The last ability is minus the sum of the others.
  effect <- function(name) {
    own <- outer(name, items, "==") + 0
    own[, -length(items), drop = FALSE] - own[, length(items)]
  }
  weights <- share[, 1] * effect(names[, 1]) + share[, 2] * effect(names[, 2])
  colnames(weights) <- paste0("ability", seq_len(ncol(weights)))
  both_orders <- any(paste(names[, 2], names[, 1], sep = "\r") %in% counts$pair)
  if (both_orders) weights <- cbind(weights, order = (share[, 1] - share[, 2]) / 2)
  if (ties) weights <- cbind(weights, tie = (counts$answer == "tie") + 0)
  pair <- model.matrix(~ pair - 1, counts)
  fit <- tryCatch(
    glm.fit(cbind(weights, pair), counts$Freq, family = poisson(),
            control = list(epsilon = 1e-14, maxit = 100)),
    warning = function(why) NULL, error = function(why) NULL)
  if (is.null(fit) || !fit$converged || ncol(pair) < 1) {
    cat("part ", part, ": the abilities have no estimate\n", sep = "")
    next
  }
  covariance <- chol2inv(fit$qr$qr[seq_along(fit$coefficients), , drop = FALSE])
  covariance <- covariance[order(fit$qr$pivot), order(fit$qr$pivot)]
  own <- seq_len(ncol(weights))
  estimate <- fit$coefficients[own]
  covariance <- covariance[own, own, drop = FALSE]
  contrast <- rbind(diag(length(items) - 1), -1)
  contrast <- cbind(contrast, matrix(0, length(items), ncol(weights) - length(items) + 1))
  ability <- as.vector(contrast %*% estimate)
  spread <- contrast %*% covariance %*% t(contrast)
  put <- of_part(part)
  print(data.frame(item = items, ability = ability, se = sqrt(diag(spread))))
  for (i in seq_along(items)) {
    put(paste0("pairs/ability/", items[i]), ability[i])
    put(paste0("pairs/ability_se/", items[i]), sqrt(spread[i, i]))
    for (j in seq_along(items)) if (j > i) {
      group <- paste0("pairs/", items[i], "|", items[j])
      put(paste0(group, "/difference"), ability[i] - ability[j])
      put(paste0(group, "/se"), sqrt(spread[i, i] + spread[j, j] - 2 * spread[i, j]))
    }
  }
  named <- function(what) match(what, colnames(weights))
  if (both_orders) {
    put("pairs/order", estimate[[named("order")]])
    put("pairs/order_se", sqrt(covariance[named("order"), named("order")]))
  }
  if (ties) {
    put("pairs/tie_log_nu", estimate[[named("tie")]])
    put("pairs/tie_log_nu_se", sqrt(covariance[named("tie"), named("tie")]))
  }
  vaf <- realizations$vaf[match(items, realizations$id)]
  if (sum(!is.na(vaf)) > 2 && sd(vaf, na.rm = TRUE) > 0) {
    found <- correlated(vaf[!is.na(vaf)], ability[!is.na(vaf)])
    put("pairs/vaf/pearson/r", found$r)
    put("pairs/vaf/pearson/p_exact_two_sided", found$p_exact)
  }
}

#' ## Tracks
#'
#' The thresholds of `thresholds.csv` (posterior medians of `study analyze`) are compared by the
#' linear mixed model of their logarithms; whether two realizations are told apart, by a t test
#' of what is 0 by chance. `sensitivities.csv` has the d' by which groups and sessions are compared.

for (part in kept("tracks")) {
  answers <- ratings[ratings$included & ratings$part == part & !is.na(ratings$correct), ]
  put <- of_part(part)
  print(aggregate(cbind(share_correct = correct) ~ participant + track, data = answers, FUN = mean))
  sessions <- kept(paste("session", part))
  tracks <- kept(paste("method", part))
  for (track in tracks[!(tracks %in% answers$track[!is.na(answers$level)])]) {
    for (session in if (length(sessions) > 1) sessions else NA) {
      own <- answers[answers$track == track, ]
      if (!is.na(session)) own <- own[own$session_id == session, ]
      if (nrow(own) == 0) next
      method <- setting(paste("method", part, track))
      given <- as.character(own[[setting(paste("tracks", part))]])
      words <- switch(method, "same-different" = c("different", "same"), "yes-no" = c("yes", "no"),
                      c("first", "second"))
      target <- ifelse(own$correct, given, ifelse(given == words[1], words[2], words[1]))
      above <- vapply(split(seq_len(nrow(own)), droplevels(own$participant)), function(rows) {
        if (method %in% c("3ifc", "odd-one-out")) return(mean(own$correct[rows]) - 1 / 3)
        rate <- function(word) {
          asked <- rows[target[rows] == word]
          (sum(given[asked] == words[1]) + 0.5) / (length(asked) + 1)
        }
        z <- qnorm(rate(words[1])) - qnorm(rate(words[2]))
        switch(method, "2ifc" = z / sqrt(2), "yes-no" = z, pnorm(z / 2) - 0.5)
      }, 0)
      if (length(above) > 1 && sd(above) > 0) {
        found <- t.test(above)
        print(found)
        name <- if (is.na(session)) track else paste0(track, "@", session)
        put(paste0("sdt_group/", name, "/above_chance/t"), unname(found$statistic))
        put(paste0("sdt_group/", name, "/above_chance/p"), found$p.value)
      }
    }
  }
  estimates <- function(file, column) {
    if (!file.exists(file)) return(NULL)
    found <- read_text(file)
    found <- found[found$part == part, ]
    data.frame(participant = found$participant, condition = found$track,
               value = as.numeric(found[[column]]), session_id = found$session)
  }
  thresholds <- estimates("thresholds.csv", "threshold")
  ratios <- isTRUE(nrow(thresholds) > 0) && !is.na(setting(paste("ratios", part)))
  all <- rbind(thresholds, estimates("sensitivities.csv", "d"))
  if (is.null(all) || nrow(all) == 0) next
  cells <- means_of(part, all)
  if (isTRUE(nrow(thresholds) > 0)) {
    own <- transform(cells, y = if (ratios) suppressWarnings(log(value)) else value)
    if (all(is.finite(own$y))) {
      own <- aggregate(y ~ participant + condition, data = own, FUN = mean)
      mixed_test(put, "psy_mixed", own)
    }
  }
  again(part, cells, ratios)
}

#' ## Comparison with `study analyze`
#'
#' The tolerance is relative for values above 1. A number that is not defined for
#' `study` is not compared.

headline <- read_text("headline.csv")
if (has_ratings && !three) {
  cat("fewer than three participants or categories: the ordinal model is not compared\n")
  headline <- headline[!startsWith(headline$id, "clmm_"), ]
}
compared <- data.frame(id = headline$id, here = unname(value[headline$id]),
                       study = as.numeric(headline$value),
                       tolerance = as.numeric(headline$tolerance))
if (any(is.na(compared$study) & !is.na(headline$value))) stop("headline.csv has no number")
compared <- compared[!is.na(compared$study), ]
compared$difference <- abs(compared$here - compared$study) / pmax(1, abs(compared$study))
compared$agrees <- !is.na(compared$difference) & compared$difference <= compared$tolerance
if (nrow(compared) > 0) print(compared, row.names = FALSE)
print(sessionInfo())
if (!all(compared$agrees)) stop("some numbers differ from those of `study analyze`")
if (nrow(compared) == 0) {
  cat("no number is computed again here: R has no test of this study's answers\n")
} else {
  cat("all ", nrow(compared), " numbers agree\n", sep = "")
}
