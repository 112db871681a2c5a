//! The psychometric functions that QUEST+ offers, each as its formula.

use super::ProcedureError;
use super::formula::Formula;
use serde::{Deserialize, Serialize};

/// The probability of a positive answer. The named functions take a stimulus
/// `intensity`; a formula may have any stimulus dimensions and parameters.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum Function {
    /// Weibull over a linear dimension: (x/t)^slope.
    Weibull,
    /// Weibull over decibels of amplitude: 10^(slope (x − t)/20).
    WeibullDb,
    /// Weibull over log10 units: 10^(slope (x − t)).
    WeibullLog10,
    /// Cumulative normal.
    Normal,
    /// Cumulative normal whose lapse rate is also its guess rate.
    NormalSymmetric,
    /// Logistic.
    Logistic,
    /// Any other, such as `gamma + (1 - gamma - lambda) Phi((intensity - mean)/sd)`.
    Formula(String),
}

impl Function {
    /// All named functions: name, formula.
    const NAMED: [(Self, &str, &str); 6] = [
        (
            Self::Weibull,
            "weibull",
            "gamma + (1 - gamma - lambda)(1 - exp(-(intensity/threshold)^slope))",
        ),
        (
            Self::WeibullDb,
            "weibull-db",
            "gamma + (1 - gamma - lambda)(1 - exp(-10^(slope (intensity - threshold)/20)))",
        ),
        (
            Self::WeibullLog10,
            "weibull-log10",
            "gamma + (1 - gamma - lambda)(1 - exp(-10^(slope (intensity - threshold))))",
        ),
        (
            Self::Normal,
            "normal",
            "gamma + (1 - gamma - lambda) Phi((intensity - mean)/sd)",
        ),
        (
            Self::NormalSymmetric,
            "normal-symmetric",
            "lambda + (1 - 2 lambda) Phi((intensity - mean)/sd)",
        ),
        (
            Self::Logistic,
            "logistic",
            "gamma + (1 - gamma - lambda)/(1 + exp(-slope (intensity - threshold)))",
        ),
    ];

    /// The function of a name, or a formula.
    pub fn parse(text: &str) -> Self {
        let named = Self::NAMED.into_iter().find(|n| n.1 == text.trim());
        named.map_or_else(|| Self::Formula(text.to_owned()), |n| n.0)
    }

    /// The names that [`parse`](Self::parse) knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::NAMED.into_iter().map(|n| n.1)
    }

    /// As it is calculated.
    pub fn text(&self) -> &str {
        match self {
            Self::Formula(text) => text,
            named => (Self::NAMED.iter().find(|n| n.0 == *named)).map_or("", |n| n.2),
        }
    }

    /// The function of variables with these names, stimulus dimensions first.
    pub(super) fn formula(&self, names: &[&str]) -> Result<Formula, ProcedureError> {
        Formula::parse(self.text(), names)
    }
}

impl From<String> for Function {
    fn from(text: String) -> Self {
        Self::parse(&text)
    }
}

impl From<Function> for String {
    fn from(function: Function) -> Self {
        let name = Function::NAMED.iter().find(|n| n.0 == function);
        name.map_or_else(|| function.text().to_owned(), |n| n.1.to_owned())
    }
}
