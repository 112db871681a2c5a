# Writes reference/factorial/*.txt: designs, and what R 4.2.2 says of them (afex 1.2.1, car 3.1.1, emmeans 1.8.4.1).
# Rscript factorial.R FOLDER [RANKS]
# With RANKS, a folder of aligned ranks that another program computed, their analyses are added.
suppressMessages({library(afex); library(emmeans); library(MASS)})
options(digits = 17); afex_options(emmeans_model = "multivariate")
args <- commandArgs(TRUE); folder <- args[1]; ranks <- args[2]
num <- function(x) paste(ifelse(is.na(x), "-", sprintf("%.15g", x)), collapse = " ")

long <- function(rows, levels, groups) {
  k <- length(levels)
  grid <- rev(expand.grid(rev(lapply(levels, seq_len))))   # last factor fastest
  names(grid) <- paste0("f", seq_len(k) - 1)
  d <- do.call(rbind, lapply(seq_len(nrow(rows)), function(s)
    cbind(s = s, g = groups[s], grid, y = rows[s, ])))
  for (n in setdiff(names(d), "y")) d[[n]] <- factor(d[[n]])
  list(d = d, grid = grid)
}
fit <- function(rows, levels, groups) {
  l <- long(rows, levels, groups)
  between <- if (length(unique(groups)) > 1) "g" else NULL
  a <- suppressMessages(suppressWarnings(
    aov_ez("s", "y", l$d, within = names(l$grid), between = between, type = 3,
           anova_table = list(correction = "none", es = c("ges", "pes")))))
  list(a = a, grid = l$grid, rows = rows)
}
# Greenhouse-Geisser and Huynh-Feldt where car has none: more contrasts than degrees of freedom.
by_hand <- function(rows, levels, groups, t, u) {
  fs <- as.integer(sub("f", "", setdiff(strsplit(t, ":")[[1]], "g"))) + 1
  C <- Reduce(kronecker, lapply(seq_along(levels), function(f)
    if (f %in% fs) qr.Q(qr(contr.sum(levels[f]))) else matrix(1 / sqrt(levels[f]), levels[f])))
  S <- crossprod(resid(if (length(unique(groups)) > 1) lm(rows %*% C ~ factor(groups)) else lm(rows %*% C ~ 1)))
  v <- eigen(S, symmetric = TRUE)$values; q <- ncol(C); df <- nrow(rows) - length(unique(groups))
  gg <- sum(v)^2 / sum(v^2) / q; hf <- ((df + 1) * q * gg - 2) / (q * (df - q * gg))
  p <- function(e) pf(u["F value"], u["num Df"] * min(e, 1), u["den Df"] * min(e, 1), lower.tail = FALSE)
  c(gg, p(gg), hf, p(hf))
}
effects <- function(a, word, rows, levels, groups) {
  s <- suppressWarnings(summary(a)); u <- s$univariate.tests; adj <- s$pval.adjustments
  es <- a$anova_table
  for (t in setdiff(rownames(u), "(Intercept)")) {
    c4 <- if (!is.null(adj) && t %in% rownames(adj)) adj[t, c("GG eps", "Pr(>F[GG])", "HF eps", "Pr(>F[HF])")] else rep(NA, 4)
    if (anyNA(c4) && grepl("f", t) && prod(levels[as.integer(sub("f", "", setdiff(strsplit(t, ":")[[1]], "g"))) + 1] - 1) > 1)
      c4 <- by_hand(rows, levels, groups, t, u[t, ])
    cat(word, t, num(c(u[t, "Sum Sq"], u[t, "Error SS"], u[t, "num Df"], u[t, "den Df"], u[t, "F value"], u[t, "Pr(>F)"],
                       c4, es[t, "pes"], es[t, "ges"])), "\n")
  }
}
tested <- function(e, w) {
  r <- summary(contrast(e, list(c = w)), infer = c(TRUE, TRUE))
  c(r$estimate, r$SE, r$df, r$t.ratio, r$p.value, r$lower.CL, r$upper.CL)
}
in_grid <- function(e, grid, w, groups = NULL) {           # weights in the order of emmeans
  eg <- as.data.frame(e); key <- function(x) do.call(paste, lapply(names(grid), function(n) as.character(x[[n]])))
  for (n in names(grid)) eg[[n]] <- sub("^X", "", as.character(eg[[n]]))
  at <- match(key(eg), key(grid)); stopifnot(!anyNA(at))
  if (is.null(groups)) w[at] else w[cbind(as.integer(as.character(eg$g)) + 1, at)]
}
design <- function(name, source, rows, levels, groups = rep(0, nrow(rows)), contrasts = TRUE) {
  sink(file.path(folder, paste0(name, ".txt"))); on.exit(sink())
  cat("source", source, "\nlevels", levels, "\n")
  if (length(unique(groups)) > 1) cat("groups", groups, "\n")
  for (s in seq_len(nrow(rows))) cat("row", num(rows[s, ]), "\n")
  m <- fit(rows, levels, groups); effects(m$a, "effect", rows, levels, groups)
  if (contrasts) {
    g <- m$grid; k <- length(levels); G <- length(unique(groups))
    e <- suppressMessages(emmeans(m$a, names(g), model = "multivariate"))
    put <- function(kind, w) {
      score <- as.vector(rows %*% w)
      sd <- if (G > 1) sigma(lm(score ~ factor(groups))) else sd(score)
      r <- tested(e, in_grid(e, g, w)); cat("contrast", kind, num(c(r, r[1] / sd)), ":", num(w), "\n")
    }
    ind <- function(f, l) as.numeric(g[[f]] == l)
    others <- function(fs) prod(levels[-fs])
    for (f in seq_len(k)) for (i in 1:(levels[f] - 1)) for (j in (i + 1):levels[f]) {
      d <- ind(f, i) - ind(f, j)
      put(paste0("marginal", f - 1), d / others(f))
      if (k > 1) for (at in unique(do.call(paste, g[-f]))) put(paste0("simple", f - 1), d * (do.call(paste, g[-f]) == at))
    }
    if (k > 1) for (p in combn(k, 2, simplify = FALSE))
      for (i in 1:(levels[p[1]] - 1)) for (j in (i + 1):levels[p[1]])
        for (u in 1:(levels[p[2]] - 1)) for (v in (u + 1):levels[p[2]])
          put(paste0("interaction", p[1] - 1, p[2] - 1),
              (ind(p[1], i) - ind(p[1], j)) * (ind(p[2], u) - ind(p[2], v)) / others(p))
    put("free", rep(1 / nrow(g), nrow(g)))
    put("free", round(sin(seq_len(nrow(g))), 3))
    if (G > 1) {
      e <- suppressMessages(emmeans(m$a, c("g", names(g)), model = "multivariate"))
      for (w in list(outer(c(1, -1, rep(0, G - 2)), rep(1 / nrow(g), nrow(g))),
                     matrix(round(cos(seq_len(G * nrow(g))), 3), G)))
        cat("group_contrast", num(tested(e, in_grid(e, g, w, TRUE))), ":", num(t(w)), "\n")
    }
  }
  if (!is.na(ranks)) {
    for (file in list.files(ranks, paste0("^", name, "\\.art\\."), full.names = TRUE)) {
      t <- sub(".*\\.art\\.", "", file); r <- fit(as.matrix(read.table(file)), levels, groups)
      text <- capture.output(effects(r$a, "art", r$rows, levels, groups))
      same <- function(x) setequal(strsplit(strsplit(x, " ")[[1]][2], ":")[[1]], strsplit(t, ".", fixed = TRUE)[[1]])
      cat(Filter(same, text), sep = "\n")
    }
    for (file in list.files(ranks, paste0("^", name, "\\.con\\."), full.names = TRUE)) {
      t <- strsplit(sub(".*\\.con\\.", "", file), ".", fixed = TRUE)[[1]]
      r <- fit(as.matrix(read.table(file)), levels, groups)
      e <- suppressMessages(emmeans(r$a, t, model = "multivariate")); eg <- as.data.frame(e)
      for (i in 1:(nrow(eg) - 1)) for (j in (i + 1):nrow(eg)) {
        w <- numeric(nrow(eg)); w[i] <- 1; w[j] <- -1; x <- suppressMessages(tested(e, w))
        level <- function(i) paste(sapply(t, function(n) as.integer(sub("^X", "", as.character(eg[i, n]))) - (n != "g")), collapse = ":")
        cat("pair", paste(t, collapse = ":"), level(i), level(j), num(x), "\n")
      }
    }
  }
}

data(obk.long, package = "afex"); o <- obk.long[order(obk.long$id, obk.long$phase, obk.long$hour), ]
o$phase <- factor(o$phase, c("pre", "post", "fup")); o <- o[order(o$id, o$phase, as.numeric(as.character(o$hour))), ]
design("obrien_kaiser", "O'Brien & Kaiser (1985), Psychological Bulletin 97: group, phase, hour",
       matrix(o$value, 16, byrow = TRUE), c(3, 5), as.integer(factor(o$treatment[seq(1, 240, 15)], c("control", "A", "B"))) - 1)
data(md_12.1, package = "afex"); m <- md_12.1[order(as.numeric(as.character(md_12.1$id)), md_12.1$noise, as.numeric(as.character(md_12.1$angle))), ]
design("maxwell_delaney", "Maxwell & Delaney (2004), Designing Experiments and Analyzing Data, table 12.1: noise, angle",
       matrix(m$rt, 10, byrow = TRUE), c(2, 3))
higgins <- c(3.3,4.3,4.5,5.8, 4.0,4.1,6.5,7.3, 1.9,3.8,4.4,5.1, 5.0,7.9,10.7,13.5, 5.9,8.5,10.3,13.9, 6.9,7.0,10.9,15.2,
             6.5,10.7,12.2,15.7, 8.2,8.9,13.4,14.9, 5.2,8.6,11.1,15.6, 6.8,9.0,10.3,12.5, 6.4,6.0,10.7,12.5, 4.0,3.8,9.4,10.2)
design("higgins", "Higgins, Blair & Tashtoush (1990), table 5: moisture (group), fertilizer",
       matrix(higgins, 12, byrow = TRUE), 4, rep(0:3, each = 3))

set.seed(40321)
simulated <- function(n, cells, effect = 0.5, digits = 2) {
  root <- matrix(rnorm(cells * cells), cells) / sqrt(cells)
  x <- 4 + rnorm(n) + matrix(rnorm(n * cells), n) %*% root + rep(effect * rnorm(cells), each = n)
  round(x, digits)
}
ratings <- function(x) matrix(pmin(7, pmax(1, round(x))), nrow(x))
design("two_by_two", "simulated", simulated(9, 4), c(2, 2))
design("two_by_three_ratings", "simulated, 1 to 7", ratings(simulated(8, 6)), c(2, 3))
design("two_by_two_by_two", "simulated", simulated(6, 8), c(2, 2, 2))
design("three_by_three", "simulated", simulated(7, 9), c(3, 3))
design("groups_of_five_and_eight", "simulated", simulated(13, 3), 3, sample(rep(0:1, c(5, 8))))
design("two_groups_by_two_by_two", "simulated, 1 to 7", ratings(simulated(11, 4)), c(2, 2), sample(rep(0:1, c(4, 7))))
design("three_groups_by_three_by_two", "simulated", simulated(13, 6), c(3, 2), sample(rep(0:2, c(3, 4, 6))))
design("four_factors", "simulated", simulated(26, 24), c(2, 3, 2, 2), contrasts = FALSE)
design("few_participants", "simulated, more contrasts than participants", simulated(5, 12), c(4, 3), contrasts = FALSE)
