//! Statistics by identifier: a number, a list, or the reason why it is undefined.

use std::collections::BTreeMap;

/// A statistic.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A finite number; flags are 0 or 1.
    Number(f64),
    /// Finite numbers.
    List(Vec<f64>),
    /// Why it is undefined.
    Undefined(String),
}

/// The statistics of an analysis. No number is NaN or infinite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Values(BTreeMap<String, Value>);

impl Values {
    /// The statistic with an identifier.
    pub fn get(&self, id: &str) -> Option<&Value> {
        self.0.get(id)
    }

    /// The value of a statistic that is a defined number.
    pub fn number(&self, id: &str) -> Option<f64> {
        match self.0.get(id) {
            Some(Value::Number(x)) => Some(*x),
            _ => None,
        }
    }

    /// The values of a statistic that is a defined list.
    pub fn list(&self, id: &str) -> Option<&[f64]> {
        match self.0.get(id) {
            Some(Value::List(x)) => Some(x),
            _ => None,
        }
    }

    /// Why a statistic is undefined.
    pub fn reason(&self, id: &str) -> Option<&str> {
        match self.0.get(id) {
            Some(Value::Undefined(why)) => Some(why),
            _ => None,
        }
    }

    /// All statistics, sorted by identifier.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Value)> + Clone {
        self.0.iter().map(|(id, value)| (id.as_str(), value))
    }

    /// Adds a statistic.
    pub(super) fn insert(&mut self, id: String, value: Value) {
        self.0.insert(id, value);
    }
}
