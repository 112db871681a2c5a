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

    /// The bounds `ID_lo` and `ID_hi` of an interval, if both are defined.
    pub fn interval(&self, id: &str) -> Option<(f64, f64)> {
        let bound = |end: &str| self.number(&format!("{id}_{end}"));
        bound("lo").zip(bound("hi"))
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

    /// Adds all statistics of another set.
    pub fn extend(&mut self, mut other: Self) {
        self.0.append(&mut other.0);
    }

    /// Copies a statistic of another set to a new identifier.
    pub(super) fn copy(&mut self, from: &Self, id: &str, to: String) {
        if let Some(value) = from.0.get(id) {
            self.0.insert(to, value.clone());
        }
    }

    /// Starts a group of statistics with a common prefix; `why` is the default reason
    /// of the undefined ones.
    pub(super) fn group(&mut self, prefix: impl Into<String>, why: impl Into<String>) -> Group<'_> {
        Group {
            values: self,
            prefix: prefix.into(),
            why: why.into(),
        }
    }
}

/// Adds the statistics of one group.
pub(super) struct Group<'a> {
    values: &'a mut Values,
    prefix: String,
    why: String,
}

impl Group<'_> {
    /// Adds a statistic that is always defined unless it overflows.
    pub(super) fn put(&mut self, name: &str, value: f64) {
        self.put_or(name, Some(value), "it overflows");
    }

    /// Adds a statistic that may be undefined for the group's reason.
    pub(super) fn maybe(&mut self, name: &str, value: Option<f64>) {
        let why = self.why.clone();
        self.put_or(name, value, &why);
    }

    /// Adds a statistic that may be undefined for a reason of its own.
    pub(super) fn put_or(&mut self, name: &str, value: Option<f64>, why: &str) {
        let value = match value {
            Some(x) if x.is_finite() => Value::Number(x),
            Some(_) => Value::Undefined("it overflows".to_owned()),
            None => Value::Undefined(why.to_owned()),
        };
        self.insert(name, value);
    }

    /// Adds the bounds of an interval, `NAME_lo` and `NAME_hi`.
    pub(super) fn interval(&mut self, name: &str, ends: Option<(f64, f64)>) {
        self.maybe(&format!("{name}_lo"), ends.map(|e| e.0));
        self.maybe(&format!("{name}_hi"), ends.map(|e| e.1));
    }

    /// Adds a list.
    pub(super) fn list(&mut self, name: &str, list: Vec<f64>) {
        let value = if list.iter().all(|x| x.is_finite()) {
            Value::List(list)
        } else {
            Value::Undefined("it overflows".to_owned())
        };
        self.insert(name, value);
    }

    fn insert(&mut self, name: &str, value: Value) {
        self.values
            .0
            .insert(format!("{}/{name}", self.prefix), value);
    }
}
