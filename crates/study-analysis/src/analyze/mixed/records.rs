//! The statistics of mixed models.

use crate::analyze::record::{Interval, RealizationName, Stat, statistics};
use std::collections::BTreeMap;

statistics! {
    /// The coefficients of a model with VAF.
    pub struct Coefficients {
        /// −2 log restricted likelihood
        reml_deviance: Stat,
        /// variance of the error
        sigma2: Stat,
        /// at VAF 0; of `lmm_vaf_slope` at `vaf_centre`
        intercept: Stat,
        /// its standard error
        intercept_se: Stat,
        /// change of the rating per unit of VAF
        slope: Stat,
        /// its standard error
        slope_se: Stat,
        /// `slope`/`slope_se`
        slope_t: Stat,
        /// Satterthwaite's
        slope_satterthwaite_df: Stat,
        /// two-sided
        slope_satterthwaite_p: Stat,
        /// t interval with these degrees of freedom
        slope_ci95: Interval,
    }

    /// A fit by maximum likelihood, and its ratio to that of the model without the effect. AIC and BIC count fixed effects, variances, covariance and σ²; BIC uses log N.
    pub struct Likelihood {
        /// −2 log likelihood
        ml_deviance: Stat,
        /// Akaike's criterion
        ml_aic: Stat,
        /// Schwarz's criterion
        ml_bic: Stat,
        /// likelihood ratio
        lrt_chi2: Stat,
        /// of `lrt_chi2`
        lrt_p: Stat,
    }

    /// A marginal mean of a realization.
    pub struct MarginalMean {
        /// the mean
        estimate: Stat,
        /// its standard error
        se: Stat,
        /// t interval with Satterthwaite's degrees of freedom
        ci95: Interval,
    }

    /// rating ~ realization + (1 | subject).
    pub struct LmmModel {
        /// −2 log restricted likelihood
        reml_deviance: Stat,
        /// variance of the subjects
        var_subject: Stat,
        /// variance of the error
        sigma2: Stat,
        /// var_subject/(var_subject + sigma2)
        icc_subject: Stat,
        /// against the model without realizations
        likelihood: Likelihood as "",
        /// realizations less one
        lrt_df: Stat,
        /// of the model without realizations
        null_ml_deviance: Stat,
        /// of the realizations
        satterthwaite_f: Stat as "satterthwaite_F",
        /// denominator degrees of freedom
        satterthwaite_df2: Stat,
        /// of F
        satterthwaite_p: Stat,
        /// of the realizations
        kenward_roger_f: Stat as "kenward_roger_F",
        /// denominator degrees of freedom
        kenward_roger_df2: Stat,
        /// of F
        kenward_roger_p: Stat,
        /// marginal means
        emm: BTreeMap<RealizationName, MarginalMean>,
    }

    /// rating ~ VAF + (1 | subject).
    pub struct LmmVaf {
        /// fixed effects
        coefficients: Coefficients as "",
        /// variance of the subjects
        var_subject: Stat,
        /// against the model without VAF
        likelihood: Likelihood as "",
        /// v/(v + var_subject + sigma2), v = slope² × the variance of VAF over ratings (n − 1)
        r2_marginal: Stat,
        /// with var_subject added to the numerator (Nakagawa & Schielzeth 2013)
        r2_conditional: Stat,
        /// the least-squares slope with **fixed** subjects, which is the limit of the mixed model's slope as the subject variance grows. The name is that of the reference file: its value there, from statsmodels 0.15, is this limit and not the REML estimate. Do not report it as a mixed model.
        statsmodels_slope: Stat,
    }

    /// rating ~ VAF + (1 + VAF | subject).
    pub struct LmmVafSlope {
        /// fixed effects
        coefficients: Coefficients as "",
        /// mean VAF
        vaf_centre: Stat,
        /// variance of the intercepts
        var_intercept: Stat,
        /// variance of the slopes
        var_slope: Stat,
        /// their covariance
        cov: Stat,
        /// 1 if a variance is 0 or a correlation ±1
        singular: Stat,
    }

    /// rating ~ VAF + (1 | subject) + (1 | realization) [+ (1 | cell)]: of the models with VAF only this one generalizes to other realizations.
    pub struct LmmVafCrossed {
        /// fixed effects
        coefficients: Coefficients as "",
        /// variance of the subjects
        var_subject: Stat,
        /// variance of the realizations
        var_model: Stat,
        /// variance of the cells, where they repeat
        var_subject_model: Option<Stat>,
        /// variance of the realizations from the same random effects and the same ratings without VAF
        var_model_without_vaf: Stat,
        /// 1 if a variance is 0
        singular: Stat,
    }

    /// The variance of the participants' slopes on VAF in rating ~ VAF + (1 + VAF | subject) + (1 | realization), with (1 | cell) if cells repeat, by restricted maximum likelihood. Up to 1,000 cells.
    pub struct SlopeVariance {
        /// the variance
        variance: Stat,
        /// its root
        sd: Stat,
        /// likelihood ratio against a variance of 0
        chi2: Stat,
        /// of an equal mixture of χ²(1) and χ²(2) (Stram & Lee 1994)
        p: Stat,
        /// mean slope
        slope: Stat,
        /// its standard error
        slope_se: Stat,
        /// its interval
        slope_ci95: Interval,
    }

    /// rating ~ 1 + (1 | subject) + (1 | realization).
    pub struct LmmCrossed {
        /// −2 log restricted likelihood
        reml_deviance: Stat,
        /// mean rating
        intercept: Stat,
        /// its standard error
        intercept_se: Stat,
        /// variance of the subjects
        var_subject: Stat,
        /// variance of the realizations
        var_model: Stat,
        /// variance of the error
        sigma2: Stat,
    }

    /// Variance components: rating ~ 1 + (1 | subject) + (1 | realization) + (1 | cell). No reference value exists for this group.
    pub struct LmmVariance {
        /// of subjects
        var_subject: Stat,
        /// relative to the sum
        share_subject: Stat,
        /// of realizations
        var_model: Stat,
        /// relative to the sum
        share_model: Stat,
        /// of cells
        var_subject_model: Stat,
        /// relative to the sum
        share_subject_model: Stat,
        /// of the error
        var_error: Stat,
        /// relative to the sum
        share_error: Stat,
        /// `corr/share/var_model_crossed`
        model_share_of_vaf: Stat,
    }

    /// Mixed models of ratings.
    pub struct Mixed {
        /// an effect of each realization
        model: LmmModel as "lmm_model",
        /// a slope on VAF
        vaf: LmmVaf as "lmm_vaf",
        /// slopes of subjects on VAF
        vaf_slope: LmmVafSlope as "lmm_vaf_slope",
        /// their variance
        slope_variance: SlopeVariance,
        /// subjects and realizations
        crossed: LmmCrossed as "lmm_crossed",
    }
}
