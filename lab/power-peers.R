# Peers of `study power`: 1,000 studies of 10 x 8 x 3 (participants x realizations x
# repetitions), each drawn and tested by lmer with Satterthwaite's degrees of freedom,
# and by simr where it is installed. Prints seconds of processor time and versions.
#
#   Rscript lab/power-peers.R [STUDIES]        (default 100, scaled to 1,000)
#
# `cargo bench --bench power` beside it simulates the same design.
suppressPackageStartupMessages({ library(lme4); library(lmerTest) })
given <- commandArgs(trailingOnly = TRUE)
studies <- if (length(given) > 0) as.integer(given[1]) else 100L
n <- 10; q <- 8; r <- 3
vaf <- c(0.6, 0.65, 0.69, 0.72, 0.77, 0.81, 0.86, 0.9)
x <- (vaf - mean(vaf)) / sqrt(mean((vaf - mean(vaf))^2))
design <- expand.grid(r = seq_len(r), model = factor(seq_len(q)), subject = factor(seq_len(n)))
design$x <- x[as.integer(design$model)]
cell <- interaction(design$subject, design$model)
draw <- function() {
  latent <- 4 + rnorm(n, sd = 0.6)[design$subject] + 0.5 * design$x +
    rnorm(q, sd = 0.5)[design$model] + rnorm(n * q, sd = 0.4)[cell] + rnorm(n * q * r, sd = 0.8)
  pmin(7, pmax(1, ceiling(latent - 0.5)))
}
set.seed(2007)
rejected <- 0
formula <- y ~ x + (1 | subject) + (1 | model) + (1 | subject:model)
time <- system.time(for (k in seq_len(studies)) {
  design$y <- draw()
  fit <- suppressMessages(suppressWarnings(lmer(formula, design)))
  rejected <- rejected + (coef(summary(fit))["x", "Pr(>|t|)"] < 0.05)
})
seconds <- sum(time[c("user.self", "sys.self")]) * 1000 / studies
cat(sprintf("%s, lme4 %s, lmerTest %s\n", R.version.string, packageVersion("lme4"), packageVersion("lmerTest")))
cat(sprintf("lmer: %.1f s per 1,000 studies (%d simulated), power %.3f\n", seconds, studies, rejected / studies))
if (requireNamespace("simr", quietly = TRUE)) {
  model <- simr::makeLmer(formula,
    fixef = c(4, 0.5), VarCorr = list(`subject:model` = 0.16, subject = 0.36, model = 0.25),
    sigma = 0.8, data = design
  )
  time <- system.time(found <- simr::powerSim(model, simr::fixed("x", "t"), nsim = studies, progress = FALSE))
  seconds <- sum(time[c("user.self", "sys.self")]) * 1000 / studies
  cat(sprintf("simr %s: %.1f s per 1,000 studies, power %.3f\n", packageVersion("simr"), seconds, found$x / found$n))
} else {
  cat("simr is not installed: SKIPPED\n")
}
