//! Figures of other packages, from the page `PEERS.md` beside the published data, where it is.

use std::path::PathBuf;

/// Times in seconds of a spline's fit at 200 points in space: package, with r² ln r, with −r.
pub(crate) fn spline_fits() -> Vec<(String, Option<f64>, Option<f64>)> {
    let path = std::env::var_os("TACTILE_PEERS").map_or_else(
        || {
            PathBuf::from(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../shared/peers/PEERS.md"
            ))
        },
        PathBuf::from,
    );
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("peers skipped: no {} (set TACTILE_PEERS)", path.display());
        return Vec::new();
    };
    let table = text
        .lines()
        .skip_while(|line| !line.starts_with("## Splines"))
        .skip(1);
    table
        .take_while(|line| !line.starts_with("##"))
        .filter_map(fits_of)
        .collect()
}

/// A row `| package kernels | fit n = 200 | …`, in milliseconds; two kernels are written `a / b`.
fn fits_of(line: &str) -> Option<(String, Option<f64>, Option<f64>)> {
    let cells: Vec<&str> = line.split('|').map(str::trim).collect();
    let (name, fit) = (*cells.get(1)?, cells.get(2)?);
    let times: Vec<f64> = fit
        .split('/')
        .map_while(|t| t.trim().parse().ok())
        .map(|ms: f64| 1e-3 * ms)
        .collect();
    let package = name.split(" r²").next()?.trim_end_matches(" −r").to_owned();
    match times[..] {
        [both, r] => Some((package, Some(both), Some(r))),
        [r] => Some((package, None, Some(r))),
        _ => None,
    }
}
