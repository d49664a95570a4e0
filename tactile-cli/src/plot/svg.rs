//! The shapes of a page as elements of an SVG file.
use std::io;
use std::mem;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use svg::Document;
use svg::node::Node;
use svg::node::element::{
    Circle, ClipPath, Element, Group, Image, Polygon, Polyline, Rectangle, Text as TextElement,
};

use super::colour::Colour;

/// An SVG file under construction.
pub(super) struct Svg {
    size: (u32, u32),
    content: Vec<Element>,
    /// How many clipping boxes have been named.
    clips: usize,
}

/// How the outline of a shape is drawn.
#[derive(Clone, Copy)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: f64,
    pub(super) dashed: bool,
}

impl Stroke {
    pub(super) const fn new(colour: Colour, width: f64) -> Self {
        Self {
            colour,
            width,
            dashed: false,
        }
    }

    /// The element with this outline.
    fn around(self, element: impl Into<Element>) -> Element {
        let mut element = element.into();
        element.assign("stroke", hex(self.colour));
        element.assign("stroke-width", self.width);
        if self.dashed {
            element.assign("stroke-dasharray", "6 4");
        }
        element
    }
}

/// What a text is and where it stands: its anchor is its middle in height.
pub(super) struct Text<'a> {
    pub(super) content: &'a str,
    pub(super) at: [f64; 2],
    pub(super) size: f64,
    pub(super) colour: Colour,
    pub(super) anchor: Anchor,
    /// Read from below upwards.
    pub(super) upright: bool,
}

#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Svg {
    pub(super) fn new(width: u32, height: u32) -> Self {
        let mut svg = Self {
            size: (width, height),
            content: Vec::new(),
            clips: 0,
        };
        let size = [f64::from(width), f64::from(height)];
        svg.rectangle([0.0; 2], size, Colour::WHITE, None);
        svg
    }

    pub(super) fn finish(self) -> String {
        let (width, height) = self.size;
        let mut document = Document::new()
            .set("width", width)
            .set("height", height)
            .set("viewBox", (0, 0, width, height))
            .set("font-family", "sans-serif");
        for element in self.content {
            document = document.add(element);
        }
        document.to_string()
    }

    /// What is drawn by `inside` is cut at the box.
    pub(super) fn clipped(
        &mut self,
        corner: [f64; 2],
        size: [f64; 2],
        inside: impl FnOnce(&mut Self),
    ) {
        self.clips += 1;
        let id = format!("box{}", self.clips);
        let around = mem::take(&mut self.content);
        inside(self);
        let drawn = mem::replace(&mut self.content, around);
        let mut group = Group::new().set("clip-path", format!("url(#{id})"));
        for element in drawn {
            group = group.add(element);
        }
        let clip = ClipPath::new().set("id", id).add(boxed(corner, size));
        self.content.extend([clip.into(), group.into()]);
    }

    pub(super) fn rectangle(
        &mut self,
        corner: [f64; 2],
        size: [f64; 2],
        fill: Colour,
        stroke: Option<Stroke>,
    ) {
        let filled = boxed(corner, size).set("fill", hex(fill));
        self.content.push(match stroke {
            Some(stroke) => stroke.around(filled),
            None => filled.into(),
        });
    }

    /// The outline of a box, with nothing inside.
    pub(super) fn outline(&mut self, corner: [f64; 2], size: [f64; 2], stroke: Stroke) {
        let empty = boxed(corner, size).set("fill", "none");
        self.content.push(stroke.around(empty));
    }

    pub(super) fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let line = Polyline::new()
            .set("points", list(points))
            .set("fill", "none");
        self.content.push(stroke.around(line));
    }

    pub(super) fn polygon(&mut self, points: &[[f64; 2]], fill: Colour) {
        let polygon = Polygon::new()
            .set("points", list(points))
            .set("fill", hex(fill));
        self.content.push(polygon.into());
    }

    pub(super) fn disc(&mut self, centre: [f64; 2], radius: f64, fill: Colour) {
        self.content
            .push(circle(centre, radius).set("fill", hex(fill)).into());
    }

    pub(super) fn ring(&mut self, centre: [f64; 2], radius: f64, stroke: Stroke) {
        let empty = circle(centre, radius).set("fill", "none");
        self.content.push(stroke.around(empty));
    }

    pub(super) fn text(&mut self, text: &Text<'_>) {
        let [x, y] = text.at.map(short);
        let anchor = match text.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        // A third of an em below the anchor puts the middle of lower-case letters on it.
        let mut element = TextElement::new(text.content)
            .set("x", x)
            .set("y", y)
            .set("dy", "0.35em")
            .set("font-size", text.size)
            .set("text-anchor", anchor)
            .set("fill", hex(text.colour));
        if text.upright {
            element = element.set("transform", format!("rotate(-90 {x} {y})"));
        }
        self.content.push(element.into());
    }

    /// Pixels of red, green and blue, row by row, as an embedded PNG.
    ///
    /// # Errors
    /// Those of the PNG encoder.
    pub(super) fn image(
        &mut self,
        corner: [f64; 2],
        (width, height): (u32, u32),
        rgb: &[u8],
    ) -> io::Result<()> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(rgb)?;
        writer.finish()?;
        let [x, y] = corner.map(short);
        let image = Image::new()
            .set("x", x)
            .set("y", y)
            .set("width", width)
            .set("height", height)
            .set(
                "href",
                format!("data:image/png;base64,{}", STANDARD.encode(&file)),
            );
        self.content.push(image.into());
        Ok(())
    }
}

fn boxed(corner: [f64; 2], size: [f64; 2]) -> Rectangle {
    let ([x, y], [width, height]) = (corner.map(short), size.map(short));
    Rectangle::new()
        .set("x", x)
        .set("y", y)
        .set("width", width)
        .set("height", height)
}

fn circle(centre: [f64; 2], radius: f64) -> Circle {
    let [x, y] = centre.map(short);
    Circle::new().set("cx", x).set("cy", y).set("r", radius)
}

fn hex(Colour(r, g, b): Colour) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// A coordinate to a hundredth of a pixel, never a negative zero.
fn short(v: f64) -> f64 {
    (v * 100.0).round() / 100.0 + 0.0
}

fn list(points: &[[f64; 2]]) -> String {
    let points = points.iter().map(|p| p.map(short));
    let points: Vec<String> = points.map(|[x, y]| format!("{x},{y}")).collect();
    points.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped() {
        let mut svg = Svg::new(10, 10);
        svg.text(&Text {
            content: "a < b & c > d",
            at: [1.0, 2.004],
            size: 12.0,
            colour: Colour::BLACK,
            anchor: Anchor::End,
            upright: false,
        });
        let text = svg.finish();
        assert!(
            text.contains(r#"x="1" y="2""#) && text.contains(">a &lt; b &amp; c &gt; d</text>")
        );
    }

    #[test]
    fn an_image_is_a_png_of_its_pixels() {
        let rgb: Vec<u8> = (0..18).map(|k| 14 * k).collect();
        let mut svg = Svg::new(10, 10);
        svg.image([0.0; 2], (3, 2), &rgb).unwrap();
        let text = svg.finish();
        let data = text
            .split("base64,")
            .nth(1)
            .and_then(|s| s.split('"').next())
            .unwrap();
        let file = STANDARD.decode(data).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file))
            .read_info()
            .unwrap();
        let mut found = vec![0; 18];
        let info = reader.next_frame(&mut found).unwrap();
        assert_eq!((info.width, info.height, found), (3, 2, rgb));
    }
}
