//! Uncertain numbers compared with 80-digit references (`evidence/reference_cases.py`).
use serde_json::Value;
use tactile_core::{Source, Uncertain};

const SOURCES: [Source; 4] = [
    Source::Noise,
    Source::Calibration,
    Source::PixelSize,
    Source::Own(3),
];

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().expect("a list").iter();
    values.map(|x| x.as_f64().expect("a number")).collect()
}

#[test]
fn operations_agree_with_high_precision() {
    let text = include_str!("reference/uncertain.json");
    let cases: Vec<Value> = serde_json::from_str(text).expect("the script's JSON");
    for case in &cases {
        let inputs = case["inputs"].as_array().expect("three numbers");
        let inputs: Vec<Uncertain> = (inputs.iter())
            .map(|input| {
                let row = numbers(input);
                let parts = SOURCES.into_iter().zip(&row[1..]);
                parts.fold(Uncertain::exact(row[0]), |x, (source, sd)| {
                    x.by(source, *sd)
                })
            })
            .collect();
        let [x, y, z] = inputs[..] else {
            panic!("three numbers")
        };
        let exponent = case["exponent"].as_f64().expect("a number");
        let (product, quotient) = (x * y, x / y);
        for (name, found) in [
            ("product", product),
            ("quotient", quotient),
            ("power", x.powf(exponent)),
            ("mean", Uncertain::mean(&[x, y, z])),
        ] {
            let expected = numbers(&case[name]);
            let at = format!("{name} of {}", case["name"]);
            // Some roundings of the value and of the total error, because parts of one source may
            // cancel.
            let value_error = (found.value / expected[0] - 1.0).abs();
            assert!(value_error < 2e-15, "{at}: {value_error:e}");
            let scale = found.standard_error();
            for (source, expected) in SOURCES.into_iter().zip(&expected[1..]) {
                // Noise has no sign.
                let part = found.part(source);
                let signed = source != Source::Noise;
                let part = if signed { part } else { part.abs() };
                let error = (part - expected).abs() / scale;
                assert!(error < 4e-15, "{at}, {source}: {error:e}");
            }
        }
        let covariance = case["covariance"].as_f64().expect("a number");
        let scale = product.standard_error() * quotient.standard_error();
        let error = (product.covariance(&quotient) - covariance).abs() / scale;
        assert!(error < 4e-15, "covariance of {}: {error:e}", case["name"]);
    }
}

#[cfg(feature = "serde")]
#[test]
fn what_is_written_is_read() {
    let number = Uncertain::exact(1.5).by(Source::Noise, 0.1).by_estimated(
        Source::Calibration,
        -0.2,
        Some(3.0),
    );
    let text = serde_json::to_string(&number).expect("JSON");
    let back: Uncertain = serde_json::from_str(&text).expect("what was written");
    assert_eq!(back, number);
    let estimate = r#"{"value": 2.0, "standard_error": 0.5}"#;
    let read: Uncertain = serde_json::from_str(estimate).expect("an estimate");
    assert_eq!((read.value, read.part(Source::Noise)), (2.0, 0.5));
}
