# Writes reference/glmm/*.txt: observations, and what R 4.2.2 says of them (lme4 1.1.31, numDeriv).
# Rscript glmm.R FOLDER
# Counts and shares are fitted by glmer, nAGQ = 1 and, with one random factor, nAGQ = 25. Standard errors are those
# of the Hessian, as glmer's, by Richardson's differences of its deviance (numDeriv). The modes are found to 1e-14: at
# glmer's default of 1e-7 estimates of cbpp differ by 4e-4, standard errors by 1 %. Gamma is not fitted by glmer, whose
# criterion is not the likelihood (see glmm.rs), but from the definition, by Laplace's formula and by integrate().
suppressMessages({library(lme4); library(numDeriv)})
folder <- commandArgs(TRUE)[1]
num <- function(x) paste(sprintf("%.10g", x), collapse = " ")
line <- function(...) cat(paste(...), "\n", sep = "")
ctl <- glmerControl(optimizer = "nloptwrap", optCtrl = list(xtol_abs = 1e-11, xtol_rel = 1e-11, ftol_abs = 1e-12, ftol_rel = 1e-14, maxeval = 1e5),
                    tolPwrss = 1e-14, boundary.tol = 0, check.conv.singular = "ignore", check.conv.grad = "ignore",
                    check.conv.hess = "ignore", check.nobs.vs.nRE = "ignore", calc.derivs = FALSE)

# y: counts, or successes of n; x: columns of X; g: levels, a column for each random factor.
fitted <- function(family, y, n, x, g, nAGQ) {
  d <- as.data.frame(lapply(as.data.frame(g), factor)); names(d) <- paste0("g", seq_along(d))
  d$y <- y; d$n <- n; d$x <- x
  right <- paste("0 + x", paste(sprintf("(1 | g%d)", seq_len(ncol(g))), collapse = " + "), sep = " + ")
  left <- if (family == "binomial") "cbind(y, n - y)" else "y"
  glmer(as.formula(paste(left, "~", right)), d, family = family, nAGQ = nAGQ, control = ctl)
}
# The standard deviations in the order of the factors; that of the deviance function is glmer's own.
sds <- function(f, k) sapply(seq_len(k), function(i) attr(VarCorr(f)[[paste0("g", i)]], "stddev"))
glmer_lines <- function(word, family, y, n, x, g, nAGQ) {
  f <- fitted(family, y, n, x, g, nAGQ)
  dev <- update(f, devFunOnly = TRUE)
  at <- c(getME(f, "theta"), fixef(f)); k <- length(getME(f, "theta"))
  # Where a standard deviation is 0, that of glmer is too rough; the deviance is that of the other factor.
  if (any(at[1:k] < 1e-5)) {
    left <- g[, which(sds(f, k) >= 1e-5)]; dev <- one_factor(y, n, x, left); at <- at[-which(at[1:k] < 1e-5)]; k <- 1
  }
  V <- 2 * solve(hessian(dev, at, method.args = list(d = 1e-2, r = 4)))
  se <- sqrt(diag(V))[-seq_len(k)]
  # Of several nodes glmer leaves out what does not depend on the parameters: the likelihood without random effects has it.
  ll <- as.numeric(logLik(f))
  if (nAGQ > 1) ll <- ll + constant(family, y, n)
  line(word, "beta", num(fixef(f))); line(word, "se", num(se))
  line(word, "sd", num(sds(f, ncol(g)))); line(word, "loglik", num(ll))
  f
}
# Laplace's deviance of shares with one factor, from the definition.
one_factor <- function(y, n, x, g) function(at) {
  eta <- x %*% at[-1]
  sum(sapply(split(seq_along(y), g), function(i) {
    p <- function(u) plogis(eta[i] + at[1] * u); h <- function(u) 1 + at[1]^2 * sum(n[i] * p(u) * (1 - p(u)))
    u <- 0; for (step in 1:50) u <- u + (at[1] * sum(y[i] - n[i] * p(u)) - u) / h(u)
    u^2 + log(h(u)) - 2 * sum(dbinom(y[i], n[i], p(u), log = TRUE))
  }))
}
# The log-likelihood of the saturated model.
constant <- function(family, y, n)
  if (family == "binomial") sum(dbinom(y, n, y / n, log = TRUE)) else sum(dpois(y, y, log = TRUE))

write_rows <- function(family, source, y, n, x, g) {
  line("source", source); line("family", family)
  for (i in seq_along(y)) line("row", num(c(y[i], n[i])), "|", num(x[i, ]), "|", paste(g[i, ], collapse = " "))
}
design <- function(name, source, family, y, n, x, g, term) {
  sink(file.path(folder, paste0(name, ".txt"))); on.exit(sink())
  x <- unname(x); g <- unname(as.matrix(g))
  write_rows(family, source, y, n, x, g)
  words <- c(laplace = 1, if (ncol(g) == 1) c(adaptive = 25))
  for (word in names(words)) {
    full <- glmer_lines(word, family, y, n, x, g, words[[word]])
    less <- fitted(family, y, n, x[, -term, drop = FALSE], g, words[[word]])
    line(word, "test", paste(term - 1, collapse = ","), num(2 * c(logLik(full) - logLik(less))))
  }
}

design("cbpp", "lme4: cbpp, incidence of size by period, herds", "binomial", cbpp$incidence, cbpp$size,
       model.matrix(~ period, cbpp), data.frame(as.integer(cbpp$herd)), 2:4)
design("grouseticks", "lme4: grouseticks, ticks by year and height; broods, observations and locations", "poisson", grouseticks$TICKS, rep(1, 403),
       model.matrix(~ YEAR + cHEIGHT, grouseticks),
       data.frame(as.integer(grouseticks$BROOD), as.integer(grouseticks$INDEX), as.integer(grouseticks$LOCATION)), 2:3)

# Errors of 14 participants in 2 x 3 conditions, three trials in each, some missing; participants and their cells.
set.seed(271)
d <- expand.grid(r = 1:3, b = 1:3, a = 1:2, s = 1:14)
cell <- as.integer(interaction(d$s, d$a, d$b)); us <- rnorm(14, 0, .5); uc <- rnorm(84, 0, .35)
d$y <- rpois(nrow(d), exp(.4 + .35 * (d$a == 2) + .25 * (d$b - 2) + us[d$s] + uc[cell]))
keep <- !(d$s %% 5 == 2 & d$b == 3 & d$a == 1) & !(d$r == 3 & (d$s + d$b) %% 4 == 0)
d <- transform(d, a = factor(a), b = factor(b)); contrasts(d$a) <- contr.sum(2); contrasts(d$b) <- contr.sum(3)
design("errors", "simulated: errors of participants in 2 x 3 conditions, some missing; participants and cells", "poisson",
       d$y[keep], rep(1, sum(keep)), model.matrix(~ a * b, d)[keep, ], cbind(d$s, cell)[keep, ], 5:6)

# Hits of 10 participants with 8 objects, in 6 trials each, over a covariate of the objects; both crossed.
set.seed(272)
d <- expand.grid(m = 1:8, s = 1:10); v <- c(-1.2, -.8, -.5, -.1, .2, .6, .9, 1.3)
d$y <- rbinom(nrow(d), 6, plogis(.3 + .8 * v[d$m] + rnorm(10, 0, .9)[d$s] + rnorm(8, 0, .4)[d$m]))
keep <- (d$s + 2 * d$m) %% 7 != 0
design("hits", "simulated: hits of participants with objects over a covariate, crossed, some missing", "binomial",
       d$y[keep], rep(6, sum(keep)), cbind(1, v[d$m])[keep, ], d[keep, c("s", "m")], 2)

# Single answers: Laplace's approximation and quadrature differ.
set.seed(273)
d <- expand.grid(r = 1:4, a = 0:1, s = 1:18)
d$y <- rbinom(nrow(d), 1, plogis(-.5 + .9 * d$a + rnorm(18, 0, 1.5)[d$s]))
design("answers", "simulated: single answers of participants in two conditions", "binomial", d$y, rep(1, nrow(d)), cbind(1, d$a), d["s"], 2)

# Participants who do not differ: a standard deviation of 0.
set.seed(274)
d <- expand.grid(a = 0:1, m = 1:5, s = 1:8)
d$y <- rbinom(nrow(d), 9, plogis(c(-1, .2, .6, -.4, .5)[d$m] + .5 * d$a))
design("alike", "simulated: participants who do not differ, with objects that do", "binomial", d$y, rep(9, nrow(d)), cbind(1, d$a), d[c("s", "m")], 2)

# Times of 9 participants in 3 conditions, four trials each.
set.seed(275)
d <- expand.grid(r = 1:4, c = 1:3, s = 1:9)
d$y <- signif(rgamma(nrow(d), 5, 5 / exp(1 + .3 * (d$c - 2) + rnorm(9, 0, .5)[d$s])), 5)
x <- cbind(1, d$c == 2, d$c == 3) * 1
gamma_lines <- function(word, level, columns = 1:3, test = TRUE) {
  p <- length(columns)
  nll <- function(at) {
    eta <- x[, columns, drop = FALSE] %*% at[1:p]; theta <- at[p + 1]; nu <- exp(at[p + 2])
    -sum(sapply(split(seq_len(nrow(d)), d$s), function(i) level(function(u)
      sum(dgamma(d$y[i], nu, nu / exp(eta[i] + theta * u), log = TRUE)) + dnorm(u, log = TRUE),
      function(u) 1 + theta^2 * sum(nu * d$y[i] / exp(eta[i] + theta * u)))))
  }
  o <- optim(c(rep(1, p) * (seq_len(p) == 1), .5, log(5)), nll, method = "BFGS", control = list(reltol = 1e-15, maxit = 500))
  if (!test) return(o$value)
  se <- sqrt(diag(solve(hessian(nll, o$par))))[1:p]
  line(word, "beta", num(o$par[1:p])); line(word, "se", num(se)); line(word, "sd", num(abs(o$par[p + 1])))
  line(word, "dispersion", num(exp(-o$par[p + 2]))); line(word, "loglik", num(-o$value))
  line(word, "test 1,2", num(2 * (gamma_lines(word, level, 1, FALSE) - o$value)))
}
mode_of <- function(f) optimize(f, c(-6, 6), maximum = TRUE, tol = 1e-11)
laplace <- function(f, h) { m <- mode_of(f); m$objective + .5 * log(2 * pi) - .5 * log(h(m$maximum)) }
exact <- function(f, h) {
  m <- mode_of(f); w <- 9 / sqrt(h(m$maximum))
  log(integrate(Vectorize(function(u) exp(f(u) - m$objective)), m$maximum - w, m$maximum + w, rel.tol = 1e-10)$value) + m$objective
}
sink(file.path(folder, "times.txt"))
write_rows("gamma", "simulated: times of participants in three conditions", d$y, rep(1, nrow(d)), x, cbind(d$s))
gamma_lines("laplace", laplace); gamma_lines("adaptive", exact)
sink()
