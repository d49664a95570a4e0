//! What is drawn is in the file.
use super::*;
use ndarray::array;

fn svg(panel: Panel) -> String {
    Page::new("").panel(panel).to_svg().unwrap()
}

#[test]
fn a_page_has_rows_of_panels_under_its_title() {
    let panel =
        |k: u32| Panel::new(format!("frame {k}")).points([[0.0, f64::from(k)]], Colour::BLUE, "");
    let page = Page::new("Frames").columns(2).panel_size(300, 200);
    let page = (1..=3).fold(page, |page, k| page.panel(panel(k)));
    let svg = page.to_svg().unwrap();
    let size = [r#"width="600""#, r#"height="444""#];
    assert!(
        size.iter().all(|part| svg.contains(part)),
        "two rows under a title of 44 px"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plots/frames.svg");
    page.save(&path).unwrap();
    assert_eq!(std::fs::read_to_string(path).unwrap(), svg);
}

#[test]
fn labels_and_text_are_written() {
    let panel = Panel::new("Contact radius against force")
        .x_label("force (N)")
        .y_label("contact radius (mm)")
        .error_bars([[0.2, 2.1]], [0.1], Colour::BLUE)
        .marked([[1.0, 3.0]], Marker::Ring, Colour::RED, "left out");
    let drawn = svg(panel);
    assert!(drawn.contains("contact radius (mm)") && drawn.contains("left out"));
    let lines = ["Young's modulus\t103 ± 4 kPa".to_owned()];
    let text = svg(Panel::new("Results").text(lines));
    assert!(text.contains("103 ± 4 kPa") && !text.contains('\t'));
}

#[test]
fn a_heat_map_has_its_axes_colours_and_bar() {
    let strain = array![[-0.02, 0.0, 0.01], [f64::NAN, 0.01, 0.02]];
    let map = HeatMap::of_pixels(strain.view(), [0.5, 0.5], "strain e_zz")
        .origin([10.0, 20.0])
        .range([-0.05, 0.05]);
    let drawn = svg(Panel::new("").heat_map(map));
    for label in ["strain e_zz", "-0.04", "10.5"] {
        assert!(drawn.contains(label), "{label}");
    }
    let frame = ndarray::Array2::from_elem((8, 8), 15_u8);
    let drawn = svg(Panel::new("").heat_map(HeatMap::of_frame(frame.view(), [0.1, 0.1])));
    assert!(drawn.contains("grey level") && drawn.contains("250"));
}

#[test]
fn values_colour_points_from_end_to_end() {
    let (points, rise) = ([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]], [0.0, 12.0, 40.0]);
    let drawn = svg(Panel::new("").coloured_points(points, rise, "displacement (µm)"));
    let ends_of_viridis = drawn.contains("#440154") && drawn.contains("#FDE725");
    assert!(ends_of_viridis && drawn.contains("displacement (µm)"));
}

#[test]
fn marks_have_their_shape_and_colour() {
    let marked = |marker| svg(Panel::new("").marked([[0.5, 2.0]], marker, Colour::RED, ""));
    let filled = r##"fill="#D55E00""##;
    assert!(marked(Marker::Disc).contains(filled) && !marked(Marker::Ring).contains(filled));
    let rings = Layer::Points {
        points: vec![[0.2, 1.9], [0.7, 3.3], [1.2, 3.9]],
        colour: Colour(18, 52, 86),
        marker: Marker::Ring,
        radius: 6.0,
        label: String::new(),
    };
    let drawn = svg(Panel::new("").layer(rings));
    assert_eq!(drawn.matches(r#"r="6""#).count(), 3);
    assert!(drawn.contains("#123456"));
    let pairs = [[[0.0, 0.0], [1.0, 0.2]], [[0.0, 1.0], [1.0, 1.2]]];
    let heads = |panel: Panel| svg(panel).matches("<polygon").count();
    let plain = heads(Panel::new("").segments(pairs, Colour::GREY, "match"));
    let arrows = heads(Panel::new("").arrows(pairs, Colour::GREY, "match"));
    assert_eq!(arrows, plain + 2);
}

#[test]
fn the_legend_stands_where_it_hides_least_or_where_it_is_put() {
    let rising = [[0.0, 0.0], [1e6, 1.0], [2e6, 2.0]];
    let at = |legend| {
        let panel = Panel::new("Calibration").line(rising, Colour::BLUE, "fit");
        svg(panel.legend(legend))
    };
    assert_eq!(
        at(Legend::Emptiest),
        at(Legend::UpperLeft),
        "a rising line leaves that corner free"
    );
    assert_ne!(at(Legend::UpperLeft), at(Legend::LowerRight));
}

#[test]
fn axes_count_in_steps_or_decades_and_keep_proportions() {
    let decades = [[0.0, 1e2], [1.0, 1e4], [2.0, 1e8]];
    let on = |y| {
        let panel = Panel::new("").y_label("modulus (Pa)");
        svg(panel
            .line(decades, Colour::BLUE, "")
            .scales(Scale::Linear, y))
    };
    assert!(on(Scale::Linear).contains("0.2×10⁸"));
    assert!(on(Scale::Log10).contains("1×10⁶"));
    let arrow = Panel::new("").arrows([[[0.0, 0.0], [9.0, 1.0]]], Colour::BLUE, "");
    assert_ne!(svg(arrow.clone()), svg(arrow.equal_aspect()));
    let frame = HeatMap::of_frame(array![[10, 20], [30, 40]].view(), [5.0, 5.0]);
    let over = Panel::new("").heat_map(frame);
    assert_eq!(
        svg(over.clone()),
        svg(over.image_axes()),
        "a heat map is drawn like an image"
    );
}
