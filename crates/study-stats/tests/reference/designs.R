suppressMessages({library(lme4); library(lmerTest); library(emmeans); library(ordinal)})
options(digits=12)
vafs <- c(.70,.74,.78,.79,.85,.88,.93,.95,.97)
make <- function(seed, S, k, reps, sds, keep, level=function(s) 0, slope=1.5) {
  set.seed(seed); m <- sds[2]*rnorm(k); u <- sds[1]*rnorm(S)
  d <- NULL
  for (s in 1:S) for (j in 1:k) { c <- sds[3]*rnorm(1)
    n <- keep(s,j); e <- rnorm(6)
    if (n>0) for (r in 1:n) d <- rbind(d, data.frame(s=s,m=j,
      y=min(7,max(1,round(4+level(s)+u[s]+m[j]+slope*4*(vafs[j]-.8)+c+sds[4]*e[r])))))
  }
  d$x <- vafs[d$m]; d$s <- factor(d$s); d$m <- factor(d$m); d
}
designs <- list(
 random_cells = make(1, 10, 6, 2, c(.7,.3,.4,.8), {set.seed(11); K<-matrix(sample(c(0,2,2,2,2,1),60,T),10); function(s,j) K[s,j]}),
 blocks = make(2, 10, 5, 2, c(.8,.3,.5,.7), {B<-combn(5,3); function(s,j) if (j %in% B[,s]) 2 else 0}),
 lenient_severe = make(3, 16, 7, 1, c(.4,.2,.4,.6), function(s,j) as.integer(if (s<=8) j<=5 else j>=3), level=function(s) if (s<=8) 1 else -1),
 nobody_complete = make(4, 8, 5, 1, c(.8,.4,.4,.7), function(s,j) as.integer(j != (s-1)%%5+1)),
 repetitions = make(5, 9, 5, 4, c(.7,.3,.5,.8), {set.seed(15); K<-matrix(sample(1:4,45,T),9); function(s,j) K[s,j]}),
 few_subjects = make(6, 5, 9, 2, c(.6,.4,.4,.7), function(s,j) if ((s+j)%%6==0) 0 else if ((s*j)%%4==0) 1 else 2),
 no_subject_variance = make(7, 8, 5, 2, c(0,.5,.5,.8), function(s,j) if ((s*3+j)%%7==0) 0 else 2),
 no_cell_variance = make(8, 8, 6, 3, c(.8,.4,0,.9), function(s,j) if ((s+2*j)%%5==0) 0 else 1+(s+j)%%3)
)
ctl <- lmerControl(optimizer="nloptwrap", optCtrl=list(xtol_abs=1e-12,ftol_abs=1e-13,xtol_rel=1e-12,ftol_rel=1e-15,maxeval=100000),check.conv.singular="ignore")
num <- function(...) paste(sapply(c(...), function(v) format(v, digits=10, scientific=NA)), collapse=" ")
comp <- function(a, g) { v<-as.data.frame(VarCorr(a)); w<-v$vcov[v$grp==g]; if (length(w)) w else 0 }
for (n in names(designs)) { d<-designs[[n]]
  out <- character(); put <- function(...) out <<- c(out, paste(...))
  rep <- any(table(d$s,d$m)>1); S<-nlevels(d$s); k<-nlevels(d$m)
  put("covariate", num(vafs[1:k]))
  for (s in 1:S) put("ratings", paste(sapply(1:k, function(j) { w<-d$y[d$s==s & d$m==j]; if (length(w)) paste(w, collapse="") else "." }), collapse=" "))
  f <- if (rep) y~m+(1|s)+(1|s:m) else y~m+(1|s)
  a <- lmer(f, d, control=ctl)
  # Means, pairs and F of the ratings, and of the cell means.
  of <- function(f, d, prefix, df) {
    a <- lmer(f, d, control=ctl)
    put(paste0(prefix,"variances"), num(comp(a,"s"), comp(a,"s:m"), sigma(a)^2))
    e <- emmeans(a, ~m, lmer.df=df)
    t <- as.data.frame(summary(e))
    for (j in 1:k) put(paste0(prefix,"mean"), num(unlist(t[j,2:6])))
    t <- as.data.frame(summary(pairs(e, adjust="none"), infer=c(TRUE,TRUE)))
    for (i in 1:nrow(t)) put(paste0(prefix,"pair"), num(unlist(t[i,c("estimate","SE","df","lower.CL","upper.CL","t.ratio","p.value")])))
    w <- anova(a); put(paste0(prefix,"F"), num(w$`F value`, w$NumDF, w$DenDF, w$`Pr(>F)`))
  }
  of(if (rep) y~m+(1|s)+(1|s:m) else y~m+(1|s), d, "", "satterthwaite")
  of(y~m+(1|s), aggregate(y~s+m, d, mean), "cell_", "kenward-roger")
  f <- if (rep) y~x+(1|s)+(1|m)+(1|s:m) else y~x+(1|s)+(1|m)
  b <- lmer(f, d, control=ctl)
  z <- coef(summary(b))["x",]
  put("slope", num(z))
  put("slope_variances", num(comp(b,"s"), comp(b,"m"), comp(b,"s:m"), sigma(b)^2))
  # Variance of the subjects' slopes: likelihood ratio of the restricted likelihoods.
  f <- if (rep) y~x+(1+x|s)+(1|m)+(1|s:m) else y~x+(1+x|s)+(1|m)
  c2 <- lmer(f, transform(d, x=x-.8), control=ctl)
  put("slope_variance", num(as.data.frame(VarCorr(c2))$vcov[which(as.data.frame(VarCorr(c2))$var1=="x" & is.na(as.data.frame(VarCorr(c2))$var2))], REMLcrit(b)-REMLcrit(c2)))
  # Interaction of fixed subjects and realizations against repeated ratings.
  if (rep) { w <- anova(lm(y~s+m,d), lm(y~s*m,d)); put("interaction", num(w$F[2], w$Df[2], w$Res.Df[2], w$`Pr(>F)`[2])) }
  # Ordinal models: crossed random effects by Laplace's method; proportional odds.
  d$o <- ordered(d$y); cc <- clmm.control(gradTol=1e-8, maxIter=500)
  o1 <- clmm(o~x+(1|s)+(1|m), data=d, control=cc); o0 <- clmm(o~1+(1|s)+(1|m), data=d, control=cc)
  put("ordinal", num(o1$logLik, o1$beta, sqrt(vcov(o1)["x","x"]), o1$ST$s, o1$ST$m, o0$logLik))
  writeLines(out, paste0(n, ".txt"))
}
