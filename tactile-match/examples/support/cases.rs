//! Files of cases with known partners.
//!
//! A case is `case NAME D n_model n_target`, then rows `m` (model), `t` (target), `g` (true
//! position of each model row) and `p` (row of its true partner, −1 for none).
#![allow(dead_code)] // a study need not look at all of a case

/// One case of the file.
#[derive(Default)]
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) dimension: usize,
    pub(crate) model: Vec<Vec<f64>>,
    pub(crate) target: Vec<Vec<f64>>,
    pub(crate) truth: Vec<Vec<f64>>,
    pub(crate) partner: Vec<i64>,
}

pub(crate) fn read(text: &str) -> Result<Vec<Case>, Box<dyn std::error::Error>> {
    let mut cases: Vec<Case> = Vec::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let tag = words.next().unwrap_or_default();
        if tag == "case" {
            let name = words.next().ok_or("a case without a name")?.to_owned();
            let dimension = words.next().ok_or("a case without a dimension")?.parse()?;
            cases.push(Case {
                name,
                dimension,
                ..Case::default()
            });
            continue;
        }
        let case = cases.last_mut().ok_or("a row before the first case")?;
        if tag == "p" {
            case.partner
                .push(words.next().ok_or("a partner without a row")?.parse()?);
            continue;
        }
        let row = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match tag {
            "m" => case.model.push(row),
            "t" => case.target.push(row),
            "g" => case.truth.push(row),
            _ => {}
        }
    }
    Ok(cases)
}
