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
  sum <- sha256(file)
  if (is.na(sum)) {
    cat(file, ": its SHA-256 was not compared, no program computes it here\n", sep = "")
  } else if (sum != setting(key)) {
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
if (has_ratings) {
  print(table(because = ratings$not_used_because, useNA = "no"))
  counted <- ratings[ratings$included & !is.na(ratings[[question]]) & ratings$status != "failed", ]
  counted$rating <- counted[[question]]
  counted$model <- droplevels(counted$model)
  repeats <- realizations$id[!is.na(realizations$duplicate_of)]
  tested <- counted[counted$role == "test" & !(counted$model %in% repeats), ]
  tested$model <- droplevels(tested$model)
  tested$participant <- droplevels(tested$participant)
} else {
  cat("The primary question is no rating. These are the answers and their numbers:\n")
  columns <- intersect(c("part", "track", "level", "correct"), names(ratings))
  answered <- ratings[ratings$status == "ok" & !ratings$practice, ]
  if (any(!is.na(answered$correct))) {
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

#' ## VAF and mean rating
#'
#' The mean of each participant's ratings of a realization, then the mean over
#' participants; Pearson's correlation with the VAF over the realizations, and its exact
#' permutation test.

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
  if (length(means) <= 8) {
    orders <- function(x) {
      if (length(x) < 2) return(list(x))
      do.call(c, lapply(seq_along(x), function(i) lapply(orders(x[-i]), function(o) c(x[i], o))))
    }
    x <- vaf - mean(vaf)
    y <- means - mean(means)
    sums <- abs(vapply(orders(seq_along(y)), function(o) sum(x * y[o]), 0))
    observed <- abs(sum(x * y))
    value["corr/pearson/p_exact_two_sided"] <-
      mean(sums >= observed - 1e-10 * sqrt(sum(x^2) * sum(y^2)))
  }
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
  control <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhobeg = 0.2, rhoend = 1e-9),
                         check.conv.singular = "ignore")
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

#' ## Ordinal mixed model
#'
#' The ratings as ordered categories. `clmm` needs the standardized VAF: with the raw one
#' its standard errors are off by up to 1 %, and at least three participants.

three <- enough && nlevels(droplevels(with_vaf$participant)) > 2
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

#' ## Comparison with `study analyze`
#'
#' The tolerance is relative for values above 1. A number that is not defined for
#' `study` is not compared.

headline <- read_text("headline.csv")
if (has_ratings && !three) {
  cat("fewer than three participants: the ordinal model is not compared\n")
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
cat("all ", nrow(compared), " numbers agree\n", sep = "")
