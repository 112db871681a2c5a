# Reference values for measured outcomes: R 4.2.2 with afex 1.2.1, emmeans 1.8.4.1, lme4 1.1.31,
# pbkrtest 0.5.2. Writes two tables of simulated trials and what R says of them:
#   Rscript outcomes.R          in this folder
suppressMessages({ library(afex); library(emmeans); library(lme4) })
options(digits = 17)
afex_options(type = 3, check_contrasts = TRUE)

line <- function(out, id, value) cat(id, sprintf("%.15g", value), "\n", file = out, append = TRUE)

# Numbers of an outcome by realization, over its trials.
describe <- function(out, name, d, y, log) {
  for (m in levels(d$model)) {
    x <- d[[y]][d$model == m]
    id <- paste0("outcomes/", name, "/desc/", m)
    line(out, paste0(id, "/n"), length(x))
    line(out, paste0(id, "/mean"), mean(x))
    line(out, paste0(id, "/sd"), sd(x))
    line(out, paste0(id, "/median"), median(x))
    if (log) line(out, paste0(id, "/geometric_mean"), exp(mean(base::log(x))))
  }
}

# What is compared: marginal means of lmer of the cell means, Kenward and Roger's intervals.
compare <- function(out, name, cells, back) {
  fit <- lmer(y ~ model + (1 | subject), cells)
  means <- as.data.frame(emmeans(fit, ~ model, lmer.df = "kenward-roger"))
  for (i in seq_len(nrow(means))) {
    id <- paste0("outcomes/", name, "/desc/", means$model[i])
    line(out, paste0(id, "/center"), back(means$emmean[i]))
    line(out, paste0(id, "/center_ci95_lo"), back(means$lower.CL[i]))
    line(out, paste0(id, "/center_ci95_hi"), back(means$upper.CL[i]))
  }
  means
}

effects_of <- function(fit) {
  table <- fit$anova_table
  plain <- summary(fit)$univariate.tests
  corrections <- summary(fit)$pval.adjustments
  for (effect in rownames(table)) {
    eps <- if (!is.null(corrections) && effect %in% rownames(corrections)) corrections[effect, "GG eps"] else 1
    df1 <- plain[effect, "num Df"]; df2 <- plain[effect, "den Df"]; f <- plain[effect, "F value"]
    p <- pf(f, eps * df1, eps * df2, lower.tail = FALSE)
    effects[[effect]] <<- list(f = f, df1 = df1, df2 = df2, eps = eps, p = p, ges = table[effect, "ges"])
  }
}

# --- 1. Five realizations, two repetitions, twelve participants ---------------------------------
set.seed(20071)
realizations <- data.frame(model = paste0("r", 1:5), vaf = c(.70, .78, .85, .91, .97),
                           slow = c(.30, .22, .05, .08, -.10))
d <- expand.grid(repetition = 1:2, model = realizations$model, subject = sprintf("P%02d", 1:12))
d <- merge(d, realizations, sort = FALSE)
d <- d[order(d$subject, d$model, d$repetition), ]
person <- setNames(rnorm(12, 0, .4), sprintf("P%02d", 1:12))
taste <- matrix(rnorm(60, 0, .15), 12)
d$time <- round(exp(2 + d$slow + person[as.character(d$subject)] +
  taste[cbind(as.integer(factor(d$subject)), as.integer(factor(d$model)))] + rnorm(nrow(d), 0, .3)), 3)
d$answer <- round(2 + 3 * d$vaf + .5 * person[as.character(d$subject)] + rnorm(nrow(d), 0, .8), 3)
d$rating <- pmin(7, pmax(1, round(1 + 5 * d$vaf + rnorm(nrow(d)))))
d$model <- factor(d$model); d$subject <- factor(d$subject)
write.csv(d[c("subject", "model", "repetition", "rating", "vaf", "time", "answer")],
          "realizations.csv", row.names = FALSE, quote = FALSE)

out <- "realizations.txt"
cat("", file = out)
outcomes <- list(time = list(f = base::log, back = exp, log = TRUE),
                 answer = list(f = identity, back = identity, log = FALSE))
p <- c()
for (name in names(outcomes)) {
  o <- outcomes[[name]]
  describe(out, name, d, name, o$log)
  d$y <- o$f(d[[name]])
  cells <- aggregate(y ~ subject + model, d, mean)
  means <- compare(out, name, cells, o$back)
  vaf <- realizations$vaf[match(means$model, realizations$model)]
  line(out, paste0("outcomes/", name, "/vaf/r"), cor(vaf, means$emmean))
  line(out, paste0("outcomes/", name, "/vaf/rho"), cor(vaf, means$emmean, method = "spearman"))
  effects <- list()
  effects_of(aov_ez("subject", "y", cells, within = "model", anova_table = list(es = "ges")))
  e <- effects$model
  id <- paste0("outcomes/", name)
  line(out, paste0(id, "/rmanova/F"), e$f)
  line(out, paste0(id, "/rmanova/p_gg"), e$p)
  line(out, paste0(id, "/rmanova/ges"), e$ges)
  line(out, paste0(id, "/differ/statistic"), e$f)
  line(out, paste0(id, "/differ/df1"), e$df1 * e$eps)
  line(out, paste0(id, "/differ/df2"), e$df2 * e$eps)
  line(out, paste0(id, "/differ/p"), e$p)
  line(out, paste0(id, "/differ/effect"), e$ges)
  p[name] <- e$p
}
for (name in names(p)) line(out, paste0("outcomes/", name, "/differ/p_holm"), p.adjust(p, "holm")[[name]])

# --- 2. Two by three factors, ten participants ---------------------------------------------------
set.seed(20072)
d <- expand.grid(detent = c("soft", "medium", "crisp"), friction = c("low", "high"), subject = sprintf("P%02d", 1:10))
person <- setNames(rnorm(10, 0, .4), sprintf("P%02d", 1:10))
d$time <- round(exp(1.5 + .35 * (d$friction == "high") + .1 * (d$detent == "crisp") +
  person[as.character(d$subject)] + rnorm(nrow(d), 0, .3)), 3)
d$answer <- round(4 + .6 * (d$friction == "high") * (d$detent == "crisp") + rnorm(nrow(d), 0, .7), 3)
d$rating <- pmin(7, pmax(1, round(4 + (d$detent == "crisp") + rnorm(nrow(d)))))
d$model <- factor(paste(d$friction, d$detent, sep = "-"))
d$repetition <- 1
d$subject <- factor(d$subject)
write.csv(d[c("subject", "model", "repetition", "rating", "time", "answer")],
          "factors.csv", row.names = FALSE, quote = FALSE)
out <- "factors.txt"
cat("", file = out)
p <- c()
for (name in names(outcomes)) {
  o <- outcomes[[name]]
  describe(out, name, d, name, o$log)
  d$y <- o$f(d[[name]])
  compare(out, name, d, o$back)
  effects <- list()
  fit <- aov_ez("subject", "y", d, within = c("friction", "detent"), anova_table = list(es = "ges"))
  effects_of(fit)
  for (effect in names(effects)) {
    e <- effects[[effect]]
    id <- paste0("outcomes/", name, "/factorial/", effect)
    line(out, paste0(id, "/F"), e$f)
    line(out, paste0(id, "/df1"), e$df1)
    line(out, paste0(id, "/df2"), e$df2)
    line(out, paste0(id, "/eps_gg"), e$eps)
    line(out, paste0(id, "/p_gg"), e$p)
    line(out, paste0(id, "/ges"), e$ges)
    p[paste0(id, "/p_holm")] <- e$p
  }
  means <- as.data.frame(emmeans(fit, ~ friction, model = "multivariate"))
  for (i in 1:2) line(out, paste0("outcomes/", name, "/factorial_mean/friction=", means$friction[i], "/mean"), means$emmean[i])
  pair <- summary(pairs(emmeans(fit, ~ friction, model = "multivariate")), infer = TRUE)
  sign <- if (startsWith(as.character(pair$contrast), "low")) 1 else -1
  line(out, paste0("outcomes/", name, "/factorial_contrast/friction=low|high/difference"), sign * pair$estimate)
  line(out, paste0("outcomes/", name, "/factorial_contrast/friction=low|high/t"), sign * pair$t.ratio)
}
for (id in names(p)) line(out, id, p.adjust(p, "holm")[[id]])
