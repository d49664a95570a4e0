//! Tests that drawn elements are in the file.
use super::super::axis::label;
use super::*;
use ndarray::array;
use plotters::coord::ranged1d::ValueFormatter;

fn svg(panel: Panel) -> String {
    Page::new("", 1, vec![panel]).to_svg().unwrap()
}

fn panel() -> Panel {
    Panel::new(
        "Contact radius against force",
        "force (N)",
        "contact radius (mm)",
    )
}

#[test]
fn a_page_has_rows_of_panels_under_its_title() {
    let panels = (1..=3).map(|k| panel().points([[0.0, f64::from(k)]], Colour::Blue, ""));
    let svg = Page::new("Frames", 2, panels.collect()).to_svg().unwrap();
    // Two panels of 560 px beside each other, two rows of 420 px under a title of 44 px.
    assert!(svg.contains(r#"<svg width="1120" height="884""#));
    assert_eq!(svg.matches("<svg ").count(), 5, "page, title and panels");
}

#[test]
fn names_are_written_without_markup_and_control_characters() {
    let lines = ["a < b & c\u{1b}\t103 ± 4 kPa".to_owned()];
    let drawn = svg(Panel::of_text("Results", lines));
    assert!(drawn.contains("a &lt; b &amp; c\u{fffd}") && drawn.contains("103 ± 4 kPa"));
    let rings = panel().rings([[1.0, 3.0]], Colour::Red, "left out");
    let drawn = svg(rings);
    assert!(drawn.contains("contact radius (mm)") && drawn.contains("left out"));
}

#[test]
fn a_heat_map_is_a_picture_with_a_bar() {
    let strain = array![[-0.02, 0.0, 0.01], [f64::NAN, 0.01, 0.02]];
    let map = HeatMap::of_pixels(strain.view(), [0.5, 0.5], "strain e_zz").origin([10.0, 20.0]);
    let png = map.png([3.0, 2.0], false).unwrap();
    let picture = image::load_from_memory(&png).unwrap().to_rgb8();
    let ends = [picture.get_pixel(0, 0).0, picture.get_pixel(2, 1).0];
    assert_eq!(ends, [[68, 1, 84], [254, 232, 37]], "ends of viridis");
    assert_eq!(picture.get_pixel(0, 1).0, [235; 3], "no value");
    let drawn = svg(panel().heat_map(map));
    assert_eq!(drawn.matches("<image").count(), 2, "map and bar");
    for label in ["strain e_zz", "-0.02", "10.5"] {
        assert!(drawn.contains(label), "{label}");
    }
}

#[test]
fn values_colour_points_from_end_to_end() {
    let (points, rise) = ([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]], [0.0, 12.0, 40.0]);
    let drawn = svg(panel().valued_points(points, rise, "displacement (µm)"));
    let ends = drawn.contains("#440154") && drawn.contains("#FEE825");
    assert!(ends && drawn.contains("displacement (µm)"));
}

#[test]
fn arrows_have_heads_and_broken_lines_are_broken() {
    let pairs = [[[0.0, 0.0], [1.0, 0.2]], [[0.0, 1.0], [1.0, 1.2]]];
    let heads = |panel: Panel| svg(panel).matches("<polygon").count();
    assert_eq!(heads(panel().segments(pairs, Colour::Grey, "match")), 0);
    assert_eq!(heads(panel().arrows(pairs, Colour::Grey, "match")), 2);
    let blue = |line: [[f64; 2]; 5]| {
        svg(panel().line(line, Colour::Blue, ""))
            .matches("#0072B2")
            .count()
    };
    let whole = [0.0, 1.0, 2.0, 3.0, 4.0].map(|x| [x, x]);
    let mut broken = whole;
    broken[2][1] = f64::NAN;
    assert_eq!((blue(whole), blue(broken)), (1, 2));
}

#[test]
fn a_legend_stands_above_the_axes_in_as_many_rows_as_it_needs() {
    let line = [[0.0, 0.0], [1.0, 1.0]];
    let name = "a name of thirty-four characters..";
    let few = panel().line(line, Colour::Blue, "fit");
    assert_eq!(few.legend(560).last().map(|e| e.row), Some(0));
    let many = few
        .line(line, Colour::Red, name)
        .line(line, Colour::Green, name);
    assert_eq!(many.legend(560).last().map(|e| e.row), Some(1));
}

#[test]
fn axes_are_around_the_data_and_heat_maps_are_not_cut() {
    let around = |panel: Panel| panel.axes().map(|axis| axis.length());
    let line = panel().line([[0.0, 2.0], [10.0, 2.0]], Colour::Blue, "");
    let [x, y] = around(line);
    // The margin is 4 % at both ends, or a tenth of the value if all values are equal.
    assert!((x - 10.8).abs() < 1e-12 && (y - 0.4).abs() < 1e-12);
    let frame = HeatMap::of_frame(array![[10, 20], [30, 40]].view(), [5.0, 5.0]);
    assert_eq!(around(panel().heat_map(frame)), [10.0, 10.0]);
}

fn labels(logarithmic: bool, ends: [f64; 2], wanted: usize) -> Vec<String> {
    let axis = Axis::around(ends.into_iter(), logarithmic, 0.0);
    let ticks = axis.ticks(wanted).into_iter();
    ticks.map(|tick| axis.format_ext(&tick)).collect()
}

#[test]
fn labels_are_short() {
    let labels = [0.25, 1200.0, 3e6, -2.5e-7, 0.0].map(|v| label(v, 0.0));
    assert_eq!(labels, ["0.25", "1200", "3×10⁶", "-2.5×10⁻⁷", "0"]);
}

#[test]
fn ticks_are_round_and_an_axis_keeps_one_power_of_ten() {
    assert_eq!(
        labels(false, [-3.0, 97.0], 5),
        ["0", "20", "40", "60", "80"]
    );
    assert_eq!(
        labels(false, [0.0, 0.2], 4),
        ["0", "0.05", "0.1", "0.15", "0.2"]
    );
    let small = labels(false, [-6e-4, 1.1e-3], 4);
    assert_eq!(small, ["-0.5×10⁻³", "0", "0.5×10⁻³", "1×10⁻³"]);
}

#[test]
fn logarithmic_ticks_are_powers_of_ten_or_2_and_5_times_them() {
    assert_eq!(labels(true, [2.0, 2e4], 5), ["10", "100", "1000", "10000"]);
    assert_eq!(labels(true, [0.8, 12.0], 5), ["1", "2", "5", "10"]);
}
