# Reference values of crates/study-stats/src/ranking/tests.rs: Rscript ranking.R (R 4.2.2, numDeriv).
# The likelihood of Davidson and Luce (Turner et al. 2020, Computational Statistics 35, section 2.1) is written out here and
# maximized by optim; of `fruits` it is also compared with what the package PlackettLuce 0.4.4 prints in its tests.
suppressMessages(library(numDeriv))
options(digits = 12)

# Salad dressings ranked by tartness by 32 judges, 1 the most tart: Vargo (1989) in Critchlow & Fligner (1991),
# Psychometrika 56, 517-533; `salad` of the packages prefmod and PlackettLuce. Each row with how often it was given.
salad <- matrix(c(
  4, 3, 2, 1,  3, 4, 2, 1,  4, 3, 1, 2,  4, 1, 3, 2,  3, 1, 4, 2,  4, 2, 1, 3,
  4, 1, 2, 3,  2, 1, 4, 3,  2, 3, 1, 4,  3, 1, 2, 4,  2, 1, 3, 4,  1, 2, 3, 4), ncol = 4, byrow = TRUE)
salad <- salad[rep(1:12, c(1, 1, 1, 6, 1, 3, 11, 2, 1, 2, 1, 2)), ]

# The example of the tests of PlackettLuce; 0 is not ranked.
fruits <- matrix(c(
  1, 2, 0,  3, 1, 2,  2, 1, 1,  1, 2, 3,  2, 1, 1,  1, 0, 2), ncol = 3, byrow = TRUE)

# Four judges rank five items twice each, with ties of two and of three.
tied <- matrix(c(
  1, 2, 2, 4, 5,  2, 1, 3, 3, 5,  1, 1, 3, 5, 4,  1, 2, 2, 2, 5,
  2, 1, 4, 3, 4,  1, 3, 2, 5, 4,  3, 1, 2, 4, 5,  1, 2, 4, 3, 5), ncol = 5, byrow = TRUE)
judge <- rep(1:4, each = 2)

# The choices of a ranking: the set that is taken, and what it is taken from.
choices <- function(ranks) {
  ranked <- which(ranks > 0)
  all <- list()
  for (rank in sort(unique(ranks[ranked]))) {
    left <- ranked[ranks[ranked] >= rank]
    if (length(left) > 1) all <- c(all, list(list(taken = which(ranks == rank), left = left)))
  }
  all
}

# `pseudo`: so many wins and losses of each item against one that nobody ranked, as PlackettLuce adds them.
fit <- function(rankings, clusters, pseudo = 0) {
  k <- ncol(rankings)
  made <- apply(rankings, 1, choices, simplify = FALSE)
  orders <- setdiff(sort(unique(unlist(lapply(made, function(own) sapply(own, function(c) length(c$taken)))))), 1)
  weight <- function(par, set) {
    worth <- c(par[seq_len(k - 1)], -sum(par[seq_len(k - 1)]))
    n <- length(set)
    mean(worth[set]) + if (n > 1) par[k - 1 + match(n, orders)] else 0
  }
  of_choice <- function(par, choice) {
    sizes <- intersect(c(1, orders), seq_along(choice$left))
    sets <- unlist(lapply(sizes, function(n) combn(choice$left, n, simplify = FALSE)), recursive = FALSE)
    weight(par, choice$taken) - log(sum(exp(sapply(sets, function(set) weight(par, set)))))
  }
  of_ranking <- function(par, own) sum(vapply(own, of_choice, 0, par = par))
  with_pseudo <- function(par) {
    if (pseudo == 0) return(0)
    delta <- exp(par[k])
    other <- par[length(par)]
    worth <- c(par[seq_len(k - 1)], -sum(par[seq_len(k - 1)]))
    sum(pseudo * (worth + other - 2 * log(exp(worth) + exp(other) + delta * exp((worth + other) / 2))))
  }
  value <- function(par) sum(vapply(made, of_ranking, 0, par = par)) + with_pseudo(par)
  start <- rep(0, k - 1 + length(orders) + (pseudo > 0))
  found <- optim(start, function(par) -value(par), method = "BFGS", control = list(reltol = 1e-15, maxit = 1000))
  at <- found$par
  for (i in 1:5) at <- at - solve(hessian(value, at), grad(value, at))
  v <- solve(-hessian(value, at))
  scores <- t(sapply(unique(clusters), function(c) grad(function(par) sum(vapply(made[clusters == c], of_ranking, 0, par = par)), at)))
  sandwich <- v %*% crossprod(scores) %*% v
  # All worths from the parameters.
  others <- length(at) - k + 1
  map <- rbind(cbind(diag(k - 1), matrix(0, k - 1, others)), c(rep(-1, k - 1), rep(0, others)))
  first <- map[1, ] - map[2, ]
  list(
    worths = as.vector(map %*% at), ses = sqrt(diag(map %*% v %*% t(map))),
    ties = at[-seq_len(k - 1)], tie_ses = sqrt(diag(v)[-seq_len(k - 1)]), loglik = value(at),
    difference = c(sum(first * at), sqrt(first %*% v %*% first), sqrt(first %*% sandwich %*% first)))
}

# Kendall's W by hand (Kendall 1970, Rank Correlation Methods, 6.2 and 6.9): S over its largest value less the ties.
kendall_w <- function(ranks) {
  r <- t(apply(ranks, 1, rank))
  m <- nrow(r); k <- ncol(r)
  s <- sum((colSums(r) - m * (k + 1) / 2)^2)
  ties <- sum(apply(r, 1, function(row) { t <- table(row); sum(t^3 - t) }))
  w <- 12 * s / (m^2 * (k^3 - k) - m * ties)
  chi2 <- m * (k - 1) * w
  c(w = w, chi2 = chi2, p = pchisq(chi2, k - 1, lower.tail = FALSE))
}

cat("salad\n"); print(kendall_w(salad)); print(colMeans(salad)); print(friedman.test(salad)$statistic)
print(fit(salad, seq_len(nrow(salad))))
cat("fruits\n"); print(fit(fruits, seq_len(nrow(fruits))))
# coef(PlackettLuce(fruits)), with half a win and a loss of each: 0, 0.2867987, -0.4636687, tie2 -1.0701129.
with <- fit(fruits, seq_len(nrow(fruits)), 0.5)
stopifnot(all.equal(c(with$worths - with$worths[1], with$ties[1]), c(0, 0.2867987, -0.4636687, -1.0701129), tolerance = 1e-6))
cat("tied\n")
print(kendall_w(tied)); print(friedman.test(tied)$statistic); print(fit(tied, judge))
# Two rankings of a judge, their mean ranks ranked again.
mid <- t(apply(tied, 1, rank))
print(kendall_w(rowsum(mid, judge) / 2))
