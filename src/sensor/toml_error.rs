//! A TOML parser's error as one sentence with file and field.
use crate::scene::SceneError;
use std::path::Path;

/// What was wrong with a file that was read by its fields' types.
pub fn sentence(file: &Path, text: &str, error: &toml::de::Error) -> SceneError {
    let message = error.message().lines().next().unwrap_or("not TOML");
    let start = error.span().map_or(0, |span| span.start.min(text.len()));
    match field_at(text, start) {
        Some(field) if is_about_a_value(message) => SceneError::Value {
            file: file.into(),
            field,
            message: message.into(),
        },
        _ => SceneError::Syntax {
            file: file.into(),
            line: 1 + text[..start].matches('\n').count(),
            message: message.into(),
        },
    }
}

/// Whether the file is TOML, and a value is not what belongs there.
fn is_about_a_value(message: &str) -> bool {
    ["invalid", "missing field", "unknown field", "`"]
        .iter()
        .any(|start| message.starts_with(start))
        && !message.starts_with("invalid string")
}

/// The key, with its table, of the line in which a byte of the text lies.
fn field_at(text: &str, at: usize) -> Option<String> {
    let (mut table, mut key) = (String::new(), None);
    let mut begin = 0;
    for line in text.split_inclusive('\n') {
        if begin > at {
            break;
        }
        let trimmed = line.trim();
        if trimmed.starts_with('[') && trimmed.ends_with(']') && !trimmed.contains(',') {
            table = trimmed.trim_matches(['[', ']']).trim().to_owned();
            key = None;
        } else if let Some((name, _)) = line.split_once('=') {
            key = Some(name.trim().to_owned());
        }
        begin += line.len();
    }
    match (table.is_empty(), key) {
        (true, key) => key,
        (false, None) => Some(table),
        (false, Some(key)) => Some(format!("{table}.{key}")),
    }
}
