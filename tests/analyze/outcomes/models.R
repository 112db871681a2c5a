# Reference values for generalized mixed models of measured outcomes: R 4.2.2 with lme4 1.1.31, numDeriv.
# Writes a table of simulated trials and what R says of them:
#   Rscript models.R          in this folder
suppressMessages({ library(lme4); library(numDeriv) })

set.seed(371)
d <- expand.grid(repetition = 1:2, detent = c("soft", "medium", "crisp"), friction = c("low", "high"), subject = sprintf("P%02d", 1:10))
d$model <- paste(d$friction, d$detent, sep = "-")
cell <- interaction(d$subject, d$model, drop = TRUE)
level <- .5 * (d$friction == "high") + .2 * (d$detent == "crisp")
us <- function(sd) rnorm(10, 0, sd)[as.integer(factor(d$subject))]
uc <- function(sd) rnorm(nlevels(cell), 0, sd)[as.integer(cell)]
d$errors <- rpois(nrow(d), exp(.6 + level + us(.5) + uc(.3)))
d$hits <- rbinom(nrow(d), 10, plogis(.9 - level + us(.8) + uc(.4)))
d$time <- signif(rgamma(nrow(d), 8, 8 / exp(1 + level + us(.3))), 4)
d$rating <- 1 + (seq_len(nrow(d)) * 5) %% 7
# A cell of one participant is missing.
d <- d[!(d$subject == "P03" & d$model == "high-crisp"), ]
write.table(d[c("subject", "model", "repetition", "rating", "errors", "hits", "time")], "models.csv", sep = ",", quote = FALSE, row.names = FALSE)

ctl <- glmerControl(optimizer = "nloptwrap", optCtrl = list(xtol_abs = 1e-11, xtol_rel = 1e-11, ftol_abs = 1e-12, ftol_rel = 1e-14, maxeval = 1e5),
                    tolPwrss = 1e-14, check.conv.singular = "ignore", check.conv.grad = "ignore", check.conv.hess = "ignore", calc.derivs = FALSE)
d$friction <- factor(d$friction, levels = c("low", "high")); d$detent <- factor(d$detent, levels = c("soft", "medium", "crisp"))
contrasts(d$friction) <- contr.sum(2); contrasts(d$detent) <- contr.sum(3)
X <- model.matrix(~ friction * detent, d); term <- attr(X, "assign")
line <- function(id, value) cat(id, " ", sprintf("%.10g", value), "\n", sep = "", file = "models.txt", append = TRUE)
unlink("models.txt")
for (name in c("errors", "hits")) {
  fitted <- function(x) {
    d$x <- x
    formula <- paste(if (name == "hits") "cbind(hits, 10 - hits)" else name,
                     "~ 0 + x + (1 | subject) + (1 | subject:friction) + (1 | subject:detent) + (1 | subject:model)")
    # A search can stop at a standard deviation of 0: the best of three starts.
    fits <- lapply(c(.3, 1, .05), function(theta) glmer(as.formula(formula), d, family = if (name == "hits") binomial else poisson,
                                                        control = ctl, start = list(theta = rep(theta, 4), fixef = rep(0, ncol(x)))))
    fits[[which.max(sapply(fits, logLik))]]
  }
  full <- fitted(X); id <- paste0("outcomes/", name, "/model/")
  line(paste0(id, "n"), nrow(d)); line(paste0(id, "loglik"), c(logLik(full)))
  sds <- sapply(VarCorr(full), function(v) attr(v, "stddev"))
  sd_of <- function(group) { sd <- sds[[paste0(group, ".(Intercept)")]]; if (sd < 1e-4) 0 else sd }
  line(paste0(id, "sd_participant"), sd_of("subject")); line(paste0(id, "sd_cell"), sd_of("subject:model"))
  for (f in c("friction", "detent")) line(paste0(id, "sd/", f), sd_of(paste0("subject:", f)))
  effects <- c("friction", "detent", "friction:detent")
  for (t in 1:3) {
    less <- fitted(X[, term != t]); chi2 <- 2 * c(logLik(full) - logLik(less)); df <- sum(term == t)
    own <- paste0(id, "effect/", effects[t], "/")
    line(paste0(own, "chi2"), chi2); line(paste0(own, "df"), df); line(paste0(own, "p"), pchisq(chi2, df, lower.tail = FALSE))
  }
  dev <- update(full, devFunOnly = TRUE); at <- c(getME(full, "theta"), fixef(full))
  se <- sqrt(diag(2 * solve(hessian(dev, at, method.args = list(d = 1e-2, r = 4)))))[length(getME(full, "theta")) + 2]
  own <- paste0(id, "effect/friction/")
  line(paste0(own, "ratio"), exp(-2 * fixef(full)[[2]]))
  line(paste0(own, "ratio_ci95_lo"), exp(-2 * fixef(full)[[2]] - qnorm(.975) * 2 * se))
  line(paste0(own, "ratio_ci95_hi"), exp(-2 * fixef(full)[[2]] + qnorm(.975) * 2 * se))
}
