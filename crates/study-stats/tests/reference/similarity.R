# Reference values of crates/study-stats/src/similarity/tests.rs: Rscript similarity.R (R 4.2.2, vegan 2.6-4).
# Ekman (1954), "Dimensions of color vision", J. Psychol. 38: similarities of 14 colors, as in Shepard (1980), Science 210.
# With the package's file ekman.rda of smacof in the working folder they are compared with those.
suppressMessages(library(vegan))
options(digits = 12)

similarity <- c(
  .86, .42, .42, .18, .06, .07, .04, .02, .07, .09, .12, .13, .16,
  .50, .44, .22, .09, .07, .07, .02, .04, .07, .11, .13, .14,
  .81, .47, .17, .10, .08, .02, .01, .02, .01, .05, .03,
  .54, .25, .10, .09, .02, .01, .00, .01, .02, .04,
  .61, .31, .26, .07, .02, .02, .01, .02, .00,
  .62, .45, .14, .08, .02, .02, .02, .01,
  .73, .22, .14, .05, .02, .02, .00,
  .33, .19, .04, .03, .02, .02,
  .58, .37, .27, .20, .23,
  .74, .50, .41, .28,
  .76, .62, .55,
  .85, .68,
  .76)
half <- function(values, n) {
  d <- matrix(0, n, n)
  d[lower.tri(d)] <- values
  as.dist(d)
}
ekman <- half(1 - similarity, 14)
if (file.exists("ekman.rda")) {
  e <- new.env(); load("ekman.rda", e)
  stopifnot(all.equal(as.vector(1 - e$ekman), as.vector(ekman)))
}

show <- function(name, x) cat(name, format(x, digits = 12), "\n")
for (k in 1:3) {
  found <- cmdscale(ekman, k = k, eig = TRUE)
  show(paste("classical ekman, share", k), sum(found$eig[1:k]) / sum(abs(found$eig)))
}
show("classical ekman, eigenvalues", found$eig[c(1, 2, 3, 14)])
show("classical ekman, distances 0-1 0-7 3-12", as.matrix(dist(cmdscale(ekman, k = 2)))[cbind(c(1, 1, 4), c(2, 8, 13))])
euro <- cmdscale(eurodist, k = 2, eig = TRUE)
show("classical eurodist, eigenvalues", euro$eig[c(1, 2, 21)])
show("classical eurodist, Athens-Barcelona, Athens-Stockholm", as.matrix(dist(euro$points))[c(2, 20), 1])

# Ordinal scaling with the primary approach to ties: the best of 200 starts.
ordinal <- function(d, k) {
  set.seed(1)
  n <- attr(d, "Size")
  best <- Inf
  for (start in 0:200) {
    first <- if (start == 0) cmdscale(d, k = k) else matrix(rnorm(n * k), n)
    fit <- monoMDS(d, first, k = k, model = "global", weakties = TRUE, stress = 1, maxit = 5000, smin = 1e-9, sfgrmin = 1e-12, sratmax = 0.9999999999)
    best <- min(best, fit$stress)
  }
  best
}
for (k in 1:3) show(paste("ordinal ekman, stress", k), ordinal(ekman, k))
show("ordinal eurodist, stress 2", ordinal(eurodist, 2))
# Rothkopf (1957), "A measure of stimulus similarity and errors in some paired-associate learning", J. Exp. Psychol. 53: of 36
# Morse codes (a to z, 1 to 9, 0) how often, in %, two were called the same, by the one that came first (rows).
same <- as.matrix(read.table("morse.txt"))
morse <- as.dist(1 - (same + t(same)) / 200)
eigenvalues <- cmdscale(morse, k = 2, eig = TRUE)$eig
show("classical morse, share 2", sum(eigenvalues[1:2]) / sum(abs(eigenvalues)))
for (k in 2:3) show(paste("ordinal morse, stress", k), ordinal(morse, k))
show("isoMDS of MASS, from the classical map", MASS::isoMDS(morse, maxit = 1000, tol = 1e-8, trace = FALSE)$stress / 100)

# Procrustes' correlation of the classical map of the colors with wavelength, and with two properties.
wavelength <- c(434, 445, 465, 472, 490, 504, 537, 555, 584, 600, 610, 628, 651, 674)
angle <- seq(0, 13) * 2 * pi / 16
map <- cmdscale(ekman, k = 2)
one <- cbind(scale(wavelength), 0)
two <- scale(cbind(cos(angle), 3 * sin(angle)))
show("procrustes, wavelength", protest(map, one, permutations = 0)$t0)
show("procrustes, two properties", protest(map, two, permutations = 0)$t0)
# Six objects and all 720 orders.
six <- cmdscale(half(1 - as.matrix(half(similarity, 14))[1:6, 1:6][lower.tri(diag(6))], 6), k = 2)
property <- c(1, 3, 2, 5, 4, 6)
orders <- function(v) if (length(v) == 1) list(v) else do.call(c, lapply(seq_along(v), function(i) lapply(orders(v[-i]), function(o) c(v[i], o))))
r <- function(order) {
  y <- cbind(scale(property[order]), 0)
  sqrt(1 - procrustes(six, y, symmetric = TRUE)$ss)
}
all <- sapply(orders(1:6), r)
show("procrustes of six", r(1:6))
show("its p over all orders", mean(all >= r(1:6) - 1e-9))

# Four participants and five stimuli.
people <- rbind(c(1, 3, 6, 9, 2, 5, 8, 3, 7, 4), c(2, 2, 5, 8, 1, 6, 7, 4, 6, 3),
                c(0, 4, 4, 7, 3, 3, 9, 2, 8, 5), c(3, 1, 9, 6, 2, 7, 5, 5, 4, 1))
show("mean correlation", mean(cor(t(people))[lower.tri(diag(4))]))
others <- sapply(1:4, function(i) cor(people[i, ], colMeans(people[-i, ])))
show("with the others", others)
ranks <- t(apply(people, 1, rank))
m <- nrow(ranks); n <- ncol(ranks)
ties <- sum(apply(people, 1, function(x) { t <- table(x); sum(t^3 - t) }))
show("Kendall's W", (12 * sum((colSums(ranks) - m * (n + 1) / 2)^2)) / (m^2 * (n^3 - n) - m * ties))

# What they have in common, if one did not rate the last three pairs and another not the first two.
some <- people
some[1, 8:10] <- NA
some[2, 1:2] <- NA
in_common <- function(x) {
  factors <- rep(1, nrow(x))
  for (round in 1:1000) {
    common <- colMeans(x / factors, na.rm = TRUE)
    factors <- rowSums(x, na.rm = TRUE) / rowSums(sweep(!is.na(x), 2, common, "*"))
  }
  colMeans(x / factors, na.rm = TRUE)
}
common <- in_common(some / rowMeans(some, na.rm = TRUE))
show("in common, by the third pair", common / common[3])

# The interval of a correlation of .8 by three resamples of three participants.
interval <- function(r, resamples) {
  n <- 3
  half <- qt(.975, n - 1) * sqrt(n / (n - 1)) * sd(atanh(resamples))
  tanh(atanh(r) + c(-half, half))
}
show("interval, resamples .78 to .82", interval(.8, c(.78, .8, .82)))
show("interval, resamples .7 to .9", interval(.8, c(.7, .8, .9)))

# Asymmetry: three participants and three pairs, all 2^9 choices of signs.
differences <- rbind(c(4, 1, -1), c(3, -2, 2), c(5, 0, 1))
rms <- function(d) sqrt(mean(colMeans(d)^2))
signs <- as.matrix(expand.grid(rep(list(c(-1, 1)), 9)))
p <- mean(apply(signs, 1, function(s) rms(differences * s)) >= rms(differences) - 1e-9)
show("asymmetry, rms and p", c(rms(differences), p))
