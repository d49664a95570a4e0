//! The picture of a study: time across, error upwards, both in decades.

use crate::study::Study;
use std::fmt::Write;
use std::path::Path;

/// Colours of the knobs, told apart by people with any colour vision (Okabe & Ito 2008), and two
/// more.
const COLOURS: [&str; 7] = [
    "#0072b2", "#009e73", "#e69f00", "#cc79a7", "#56b4e9", "#785e3c", "#5a5ac8",
];

/// The box of the axes on the page, in pixels.
const LEFT: f64 = 80.0;
const TOP: f64 = 40.0;
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 420.0;

pub(crate) fn save(study: &Study, path: &Path) -> std::io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path, draw(study).expect("text"))
}

fn draw(study: &Study) -> Result<String, std::fmt::Error> {
    let own = study.entries.iter().map(|e| [e.seconds, e.error]);
    let peers = study
        .peers
        .iter()
        .map(|(_, seconds, error)| [*seconds, *error]);
    let all: Vec<_> = own.chain(peers).map(decades).collect();
    let axes = Axes::around(&all);
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"760\" height=\"520\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"760\" height=\"520\" \
         fill=\"white\"/>\n",
    );
    axes.draw(&mut svg, study)?;
    let front: Vec<String> = (study.front().iter())
        .filter_map(|e| axes.place(decades([e.seconds, e.error])))
        .map(|[x, y]| format!("{x:.1},{y:.1}"))
        .collect();
    let front = front.join(" ");
    writeln!(
        svg,
        "<polyline points=\"{front}\" fill=\"none\" stroke=\"grey\" stroke-dasharray=\"6 4\"/>"
    )?;
    let mut knobs: Vec<&str> = study.entries.iter().map(|e| e.knob).collect();
    knobs.dedup();
    for entry in &study.entries {
        let knob = knobs.iter().position(|k| *k == entry.knob).unwrap_or(0);
        let colour = COLOURS[knob % COLOURS.len()];
        let Some([x, y]) = axes.place(decades([entry.seconds, entry.error])) else {
            continue;
        };
        let disc = |r: f64, style: &str| {
            format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\" {style}/>")
        };
        writeln!(svg, "{}", disc(3.0, &format!("fill=\"{colour}\"")))?;
        if entry.is_default {
            writeln!(svg, "{}", disc(7.0, "fill=\"none\" stroke=\"#d55e00\""))?;
        }
    }
    for (_, seconds, error) in &study.peers {
        if let Some([x, y]) = axes.place(decades([*seconds, *error])) {
            let (left, right, top, bottom) = (x - 4.0, x + 4.0, y - 4.0, y + 4.0);
            writeln!(
                svg,
                "<path d=\"M{left:.1} {top:.1}L{right:.1} {bottom:.1}M{left:.1} \
                 {bottom:.1}L{right:.1} {top:.1}\" stroke=\"black\"/>"
            )?;
        }
    }
    let names = knobs.iter().enumerate();
    let mut legend: Vec<(&str, &str)> = names
        .map(|(k, knob)| (COLOURS[k % COLOURS.len()], *knob))
        .collect();
    legend.extend([("#d55e00", "○ default"), ("grey", "– front")]);
    if !study.peers.is_empty() {
        legend.push(("black", "× other packages"));
    }
    for (row, (colour, name)) in legend.iter().enumerate() {
        let y = TOP + 18.0 * (row as f64 + 1.0);
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{y}\" fill=\"{colour}\">{name}</text>",
            LEFT + WIDTH + 12.0
        )?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// Milliseconds and error, in decades.
fn decades([seconds, error]: [f64; 2]) -> [f64; 2] {
    [(1e3 * seconds).log10(), error.log10()]
}

/// Whole decades that hold all points.
struct Axes {
    ranges: [[f64; 2]; 2],
}

impl Axes {
    fn around(points: &[[f64; 2]]) -> Self {
        let range = |k: usize| {
            let finite = points.iter().map(|p| p[k]).filter(|v| v.is_finite());
            let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
                [l.min(v), h.max(v)]
            });
            if low > high {
                return [0.0, 1.0];
            }
            [low.floor(), high.ceil().max(low.floor() + 1.0)]
        };
        Self {
            ranges: [range(0), range(1)],
        }
    }

    /// Where a point stands on the page; an error of zero has no place.
    fn place(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        let [x, y] = [0, 1].map(|k| {
            let [low, high] = self.ranges[k];
            (point[k] - low) / (high - low)
        });
        (x.is_finite() && y.is_finite()).then_some([LEFT + x * WIDTH, TOP + (1.0 - y) * HEIGHT])
    }

    fn draw(&self, svg: &mut String, study: &Study) -> std::fmt::Result {
        let name = study.name.replace('_', " ");
        let (right, bottom) = (LEFT + WIDTH, TOP + HEIGHT);
        writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"24\" font-size=\"16\">{name}: time against error</text>"
        )?;
        writeln!(
            svg,
            "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" \
             stroke=\"black\"/>"
        )?;
        let powers = |k: usize| {
            let [low, high] = self.ranges[k];
            low as i32..=high as i32
        };
        for power in powers(0) {
            let x = LEFT
                + (f64::from(power) - self.ranges[0][0]) / (self.ranges[0][1] - self.ranges[0][0])
                    * WIDTH;
            writeln!(
                svg,
                "<path d=\"M{x:.1} {TOP}V{bottom}\" stroke=\"#ddd\"/><text x=\"{x:.1}\" y=\"{}\" \
                 text-anchor=\"middle\">1e{power}</text>",
                bottom + 18.0
            )?;
        }
        for power in powers(1) {
            let y = bottom
                - (f64::from(power) - self.ranges[1][0]) / (self.ranges[1][1] - self.ranges[1][0])
                    * HEIGHT;
            writeln!(
                svg,
                "<path d=\"M{LEFT} {y:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" \
                 text-anchor=\"end\">1e{power}</text>",
                LEFT - 6.0,
                y + 4.0
            )?;
        }
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">time / ms</text>",
            LEFT + 0.5 * WIDTH,
            bottom + 40.0
        )?;
        writeln!(
            svg,
            "<text x=\"20\" y=\"{0}\" text-anchor=\"middle\" transform=\"rotate(-90 20 \
             {0})\">{1}</text>",
            TOP + 0.5 * HEIGHT,
            study.error_label
        )
    }
}
