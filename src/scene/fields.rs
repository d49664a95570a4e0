//! Reading the fields of a TOML table, with the path of every field for errors.
use super::error::SceneError;
use crate::io::shorten;
use std::path::Path;
use toml::{Table, Value};

/// A table inside the scene file.
pub struct Fields<'a> {
    file: &'a Path,
    prefix: String,
    table: &'a Table,
}

impl<'a> Fields<'a> {
    pub fn new(file: &'a Path, table: &'a Table) -> Self {
        Self {
            file,
            prefix: String::new(),
            table,
        }
    }

    /// The field's name with its path: `waveguide.layers[2].thickness_m`.
    pub fn path(&self, name: &str) -> String {
        if self.prefix.is_empty() {
            name.into()
        } else {
            format!("{}.{name}", self.prefix)
        }
    }

    /// Refuses fields that are not in `known`.
    pub fn only(&self, known: &[&'static str]) -> Result<(), SceneError> {
        match self.table.keys().find(|key| !known.contains(&key.as_str())) {
            None => Ok(()),
            Some(key) => Err(SceneError::Unknown {
                file: self.file.into(),
                // A quoted key may hold line breaks.
                field: self.path(&shorten(key)),
                known: known.to_vec(),
            }),
        }
    }

    pub fn has(&self, name: &str) -> bool {
        self.table.contains_key(name)
    }

    pub fn missing(&self, name: &str, expected: &'static str) -> SceneError {
        SceneError::Missing {
            file: self.file.into(),
            field: self.path(name),
            expected,
        }
    }

    pub fn wrong(&self, name: &str, expected: &'static str, found: &Value) -> SceneError {
        let found = match found {
            Value::String(_) | Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => {
                // One line of a text of any length.
                shorten(&found.to_string())
            }
            Value::Array(values) => format!("an array of {}", values.len()),
            Value::Table(_) => "a table".into(),
            Value::Datetime(_) => "a date".into(),
        };
        SceneError::Wrong {
            file: self.file.into(),
            field: self.path(name),
            expected,
            found,
        }
    }

    pub fn unusable(&self, name: &str, reason: &dyn std::fmt::Display) -> SceneError {
        SceneError::Unusable {
            file: self.file.into(),
            field: self.path(name),
            reason: reason.to_string(),
        }
    }

    fn value(&self, name: &str, expected: &'static str) -> Result<&'a Value, SceneError> {
        self.table
            .get(name)
            .ok_or_else(|| self.missing(name, expected))
    }

    pub fn string(&self, name: &str, expected: &'static str) -> Result<&'a str, SceneError> {
        let value = self.value(name, expected)?;
        value
            .as_str()
            .filter(|s| !s.is_empty())
            .ok_or_else(|| self.wrong(name, expected, value))
    }

    /// A number for which `accept` holds.
    pub fn number(
        &self,
        name: &str,
        expected: &'static str,
        accept: impl Fn(f64) -> bool,
    ) -> Result<f64, SceneError> {
        let value = self.value(name, expected)?;
        as_number(value)
            .filter(|&v| accept(v))
            .ok_or_else(|| self.wrong(name, expected, value))
    }

    pub fn optional_number(
        &self,
        name: &str,
        expected: &'static str,
        accept: impl Fn(f64) -> bool,
    ) -> Result<Option<f64>, SceneError> {
        if self.has(name) {
            self.number(name, expected, accept).map(Some)
        } else {
            Ok(None)
        }
    }

    pub fn optional_flag(&self, name: &str) -> Result<Option<bool>, SceneError> {
        const EXPECTED: &str = "true or false";
        if !self.has(name) {
            return Ok(None);
        }
        let value = self.value(name, EXPECTED)?;
        let flag = value
            .as_bool()
            .ok_or_else(|| self.wrong(name, EXPECTED, value))?;
        Ok(Some(flag))
    }

    /// At least one text.
    pub fn strings(&self, name: &str, expected: &'static str) -> Result<Vec<&'a str>, SceneError> {
        let value = self.value(name, expected)?;
        let texts = value.as_array().filter(|a| !a.is_empty());
        texts
            .and_then(|a| a.iter().map(Value::as_str).collect())
            .ok_or_else(|| self.wrong(name, expected, value))
    }

    /// Two positive numbers.
    pub fn positive_pair(
        &self,
        name: &str,
        expected: &'static str,
    ) -> Result<[f64; 2], SceneError> {
        let value = self.value(name, expected)?;
        let numbers = value
            .as_array()
            .map(|a| a.iter().map(as_number).collect::<Vec<_>>());
        match numbers.as_deref() {
            Some(&[Some(x), Some(y)]) if positive(x) && positive(y) => Ok([x, y]),
            _ => Err(self.wrong(name, expected, value)),
        }
    }

    pub fn table(&self, name: &str, expected: &'static str) -> Result<Self, SceneError> {
        let value = self.value(name, expected)?;
        let table = value
            .as_table()
            .ok_or_else(|| self.wrong(name, expected, value))?;
        Ok(Self {
            file: self.file,
            prefix: self.path(name),
            table,
        })
    }

    /// At least one table in an array.
    pub fn tables(&self, name: &str, expected: &'static str) -> Result<Vec<Self>, SceneError> {
        let value = self.value(name, expected)?;
        let wrong = || self.wrong(name, expected, value);
        let values = value
            .as_array()
            .filter(|a| !a.is_empty())
            .ok_or_else(wrong)?;
        let table = |(i, v): (usize, &'a Value)| {
            let prefix = format!("{}[{}]", self.path(name), i + 1);
            v.as_table()
                .map(|table| Self {
                    file: self.file,
                    prefix,
                    table,
                })
                .ok_or_else(wrong)
        };
        values.iter().enumerate().map(table).collect()
    }
}

/// Greater than zero and finite.
pub fn positive(v: f64) -> bool {
    v > 0.0 && v.is_finite()
}

/// A Poisson ratio at which an isotropic solid is stable.
pub fn poisson(v: f64) -> bool {
    v > -1.0 && v <= 0.5
}

fn as_number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|i| i as f64))
}
