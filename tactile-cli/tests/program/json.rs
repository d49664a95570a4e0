//! Every JSON object conforms to `docs/json.schema.json`. The checker supports only the keywords
//! used there.
use serde_json::Value;

const SCHEMA: &str = include_str!("../../../docs/json.schema.json");

/// Panics if the object violates the schema or the rules in `docs/json.md`.
pub(crate) fn assert_keeps_to_schema(value: &Value, call: &str) {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    if let Err(reason) = check(value, &schema, &schema, "") {
        panic!("tactile {call}: {reason}");
    }
    numbers(value, call);
}

/// Checks a value against a schema. An error names the place of the fault.
fn check(value: &Value, schema: &Value, root: &Value, at: &str) -> Result<(), String> {
    for (keyword, rule) in schema.as_object().unwrap() {
        match keyword.as_str() {
            "$schema" | "title" | "$defs" => {}
            "$ref" => {
                let name = rule.as_str().unwrap().trim_start_matches('#');
                check(value, root.pointer(name).unwrap(), root, at)?;
            }
            "const" if value == rule => {}
            "type" if has_type(value, rule.as_str().unwrap()) => {}
            "const" | "type" => return Err(format!("{at} is {value}, expected {rule}")),
            "required" => {
                for key in rule.as_array().unwrap() {
                    if value.get(key.as_str().unwrap()).is_none() {
                        return Err(format!("{at} lacks {key}"));
                    }
                }
            }
            "properties" => {
                for (key, rule) in rule.as_object().unwrap() {
                    if let Some(inner) = value.get(key) {
                        check(inner, rule, root, &format!("{at}/{key}"))?;
                    }
                }
            }
            "items" => {
                for (k, inner) in value.as_array().into_iter().flatten().enumerate() {
                    check(inner, rule, root, &format!("{at}/{k}"))?;
                }
            }
            "anyOf" => {
                let choices = rule.as_array().unwrap().iter();
                let tried: Vec<_> = choices.map(|c| check(value, c, root, at)).collect();
                if tried.iter().all(Result::is_err) {
                    // An error that is not about `command` belongs to the right subcommand.
                    let reasons = tried.into_iter().filter_map(Result::err);
                    let longest = reasons.max_by_key(|reason| !reason.starts_with("/command"));
                    return Err(longest.unwrap_or_default());
                }
            }
            other => panic!("the keyword {other} is not checked"),
        }
    }
    Ok(())
}

fn has_type(value: &Value, name: &str) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        other => panic!("the type {other} is not checked"),
    }
}

/// Every object with a value has its error and an interval around it.
fn numbers(value: &Value, call: &str) {
    match value {
        Value::Object(object) => {
            if let Some(number) = object.get("value") {
                let ends = object.get("interval_95").and_then(Value::as_array);
                let Some([low, high]) = ends.map(Vec::as_slice) else {
                    panic!("{call}: {value}")
                };
                let (number, slack) = (number.as_f64().unwrap(), 1e-9);
                assert!(
                    object["standard_error"].as_f64().unwrap() >= 0.0,
                    "{call}: {value}"
                );
                let within = low.as_f64().is_none_or(|low| low <= number + slack)
                    && high.as_f64().is_none_or(|high| high >= number - slack);
                assert!(within, "{call}: {value}");
            }
            object.values().for_each(|inner| numbers(inner, call));
        }
        Value::Array(values) => values.iter().for_each(|inner| numbers(inner, call)),
        _ => {}
    }
}

#[test]
fn what_is_not_as_the_schema_has_it_is_named() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let reason = |text: &str| {
        let value = serde_json::from_str(text).unwrap();
        check(&value, &schema, &schema, "").unwrap_err()
    };
    assert!(reason(r#"{"schema":"tactile-2","command":"paper"}"#).contains("cautions"));
    let old = r#"{"schema":"tactile-2","command":"force","cautions":[],"frames":[
        {"frame":"a.png","contact":{"force_n":[1.0,0.1],"contact_radius_m":[1.0,0.1]}}]}"#;
    assert!(!reason(old).is_empty());
    let silent = r#"{"schema":"tactile-2","command":"light","cautions":[{"kind":"x"}],
        "rays":1,"acceptance":[]}"#;
    assert!(reason(silent).contains("text"));
}
