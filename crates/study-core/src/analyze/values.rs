//! Statistics by identifier, each a number, a list, or the reason why not.

use std::collections::BTreeMap;

/// A statistic.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A finite number; a flag is 0 or 1.
    Number(f64),
    /// Finite numbers.
    List(Vec<f64>),
    /// Why it is not defined.
    Undefined(String),
}

/// All statistics of an analysis. No number in it is NaN or infinite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Values(BTreeMap<String, Value>);

impl Values {
    /// The statistic with an identifier.
    pub fn get(&self, id: &str) -> Option<&Value> {
        self.0.get(id)
    }

    /// Its number, if it is defined and one.
    pub fn number(&self, id: &str) -> Option<f64> {
        match self.0.get(id) {
            Some(Value::Number(x)) => Some(*x),
            _ => None,
        }
    }

    /// Its numbers, if it is a list.
    pub fn list(&self, id: &str) -> Option<&[f64]> {
        match self.0.get(id) {
            Some(Value::List(x)) => Some(x),
            _ => None,
        }
    }

    /// Why it is not defined, if it is not.
    pub fn reason(&self, id: &str) -> Option<&str> {
        match self.0.get(id) {
            Some(Value::Undefined(why)) => Some(why),
            _ => None,
        }
    }

    /// All, in the order of their identifiers.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Value)> + Clone {
        self.0.iter().map(|(id, value)| (id.as_str(), value))
    }

    /// Takes over all of another's.
    pub(super) fn take(&mut self, mut other: Self) {
        self.0.append(&mut other.0);
    }

    /// Says why anew of each that is not defined.
    pub(super) fn explain(&mut self, why: impl Fn(&str) -> Option<String>) {
        for (id, value) in &mut self.0 {
            if let (Value::Undefined(old), Some(new)) = (&mut *value, why(id)) {
                *old = new;
            }
        }
    }

    /// Copies one to another identifier.
    pub(super) fn copy(&mut self, from: &Self, id: &str, to: String) {
        if let Some(value) = from.0.get(id) {
            self.0.insert(to, value.clone());
        }
    }

    /// A group of statistics under a prefix; `why` is the reason of those that
    /// come without one of their own.
    pub(super) fn group(&mut self, prefix: impl Into<String>, why: impl Into<String>) -> Group<'_> {
        Group {
            values: self,
            prefix: prefix.into(),
            why: why.into(),
        }
    }
}

/// Writes the statistics of one group.
pub(super) struct Group<'a> {
    values: &'a mut Values,
    prefix: String,
    why: String,
}

impl Group<'_> {
    /// A statistic that is always defined, but may have overflowed.
    pub(super) fn put(&mut self, name: &str, value: f64) {
        self.put_or(name, Some(value), "it overflows");
    }

    /// A statistic that is undefined for the group's reason.
    pub(super) fn maybe(&mut self, name: &str, value: Option<f64>) {
        let why = self.why.clone();
        self.put_or(name, value, &why);
    }

    /// A statistic that is undefined for its own reason.
    pub(super) fn put_or(&mut self, name: &str, value: Option<f64>, why: &str) {
        let value = match value {
            Some(x) if x.is_finite() => Value::Number(x),
            Some(_) => Value::Undefined("it overflows".to_owned()),
            None => Value::Undefined(why.to_owned()),
        };
        self.insert(name, value);
    }

    /// The two ends of an interval, `NAME_lo` and `NAME_hi`.
    pub(super) fn interval(&mut self, name: &str, ends: Option<(f64, f64)>) {
        self.maybe(&format!("{name}_lo"), ends.map(|e| e.0));
        self.maybe(&format!("{name}_hi"), ends.map(|e| e.1));
    }

    /// A list.
    pub(super) fn list(&mut self, name: &str, list: Vec<f64>) {
        let value = if list.iter().all(|x| x.is_finite()) {
            Value::List(list)
        } else {
            Value::Undefined("it overflows".to_owned())
        };
        self.insert(name, value);
    }

    /// Several that are undefined for the group's reason.
    pub(super) fn none(&mut self, names: &[&str]) {
        for name in names {
            self.maybe(name, None);
        }
    }

    fn insert(&mut self, name: &str, value: Value) {
        self.values
            .0
            .insert(format!("{}/{name}", self.prefix), value);
    }
}
