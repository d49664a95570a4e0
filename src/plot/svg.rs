//! Writing the elements of an SVG file.
use std::fmt::Write;
use std::io;

use super::colour::Colour;

/// The text of an SVG file under construction.
pub(super) struct Svg {
    text: String,
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

    fn attributes(self) -> String {
        let dash = if self.dashed {
            r#" stroke-dasharray="6 4""#
        } else {
            ""
        };
        let colour = hex(self.colour);
        format!(r#"stroke="{colour}" stroke-width="{}"{dash}"#, self.width)
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
        let text = format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\">\n"
        );
        let mut svg = Self { text, clips: 0 };
        svg.rectangle(
            [0.0; 2],
            [f64::from(width), f64::from(height)],
            Colour::WHITE,
            None,
        );
        svg
    }

    pub(super) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    /// Adds one element; writing to a string cannot fail.
    fn element(&mut self, element: std::fmt::Arguments<'_>) {
        let _ = self.text.write_fmt(element);
        self.text.push('\n');
    }

    /// What is drawn by `inside` is cut at the box.
    pub(super) fn clipped(
        &mut self,
        corner: [f64; 2],
        size: [f64; 2],
        inside: impl FnOnce(&mut Self),
    ) {
        self.clips += 1;
        let id = self.clips;
        let (place, size) = (place(corner), extent(size));
        self.element(format_args!(
            r#"<clipPath id="box{id}"><rect {place} {size}/></clipPath><g clip-path="url(#box{id})">"#
        ));
        inside(self);
        self.element(format_args!("</g>"));
    }

    pub(super) fn rectangle(
        &mut self,
        corner: [f64; 2],
        size: [f64; 2],
        fill: Colour,
        stroke: Option<Stroke>,
    ) {
        let (place, size, fill) = (place(corner), extent(size), hex(fill));
        let outline = stroke.map_or(String::new(), |s| format!(" {}", s.attributes()));
        self.element(format_args!(
            r#"<rect {place} {size} fill="{fill}"{outline}/>"#
        ));
    }

    /// The outline of a box, with nothing inside.
    pub(super) fn outline(&mut self, corner: [f64; 2], size: [f64; 2], stroke: Stroke) {
        let (place, size, stroke) = (place(corner), extent(size), stroke.attributes());
        self.element(format_args!(
            r#"<rect {place} {size} fill="none" {stroke}/>"#
        ));
    }

    pub(super) fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let (points, stroke) = (list(points), stroke.attributes());
        self.element(format_args!(
            r#"<polyline points="{points}" fill="none" {stroke}/>"#
        ));
    }

    pub(super) fn polygon(&mut self, points: &[[f64; 2]], fill: Colour) {
        let (points, fill) = (list(points), hex(fill));
        self.element(format_args!(
            r#"<polygon points="{points}" fill="{fill}"/>"#
        ));
    }

    pub(super) fn disc(&mut self, centre: [f64; 2], radius: f64, fill: Colour) {
        let ([x, y], fill) = (centre.map(short), hex(fill));
        self.element(format_args!(
            r#"<circle cx="{x}" cy="{y}" r="{radius}" fill="{fill}"/>"#
        ));
    }

    pub(super) fn ring(&mut self, centre: [f64; 2], radius: f64, stroke: Stroke) {
        let ([x, y], stroke) = (centre.map(short), stroke.attributes());
        self.element(format_args!(
            r#"<circle cx="{x}" cy="{y}" r="{radius}" fill="none" {stroke}/>"#
        ));
    }

    pub(super) fn text(&mut self, text: &Text<'_>) {
        let ([x, y], fill) = (text.at.map(short), hex(text.colour));
        let anchor = match text.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let turned = if text.upright {
            format!(r#" transform="rotate(-90 {x} {y})""#)
        } else {
            String::new()
        };
        let (size, content) = (text.size, escaped(text.content));
        // A third of an em below the anchor puts the middle of lower-case letters on it.
        self.element(format_args!(
            r#"<text x="{x}" y="{y}" dy="0.35em" font-size="{size}" text-anchor="{anchor}" fill="{fill}"{turned}>{content}</text>"#
        ));
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
        let (place, data) = (place(corner), base64(&file));
        self.element(format_args!(
            r#"<image {place} width="{width}" height="{height}" href="data:image/png;base64,{data}"/>"#
        ));
        Ok(())
    }
}

fn hex(Colour(r, g, b): Colour) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

fn place(corner: [f64; 2]) -> String {
    let [x, y] = corner.map(short);
    format!(r#"x="{x}" y="{y}""#)
}

fn extent(size: [f64; 2]) -> String {
    let [width, height] = size.map(short);
    format!(r#"width="{width}" height="{height}""#)
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

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// Base64 with padding (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |k: usize| u32::from(group.get(k).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            if digit > group.len() {
                text.push('=');
            } else {
                let value = bits >> (18 - 6 * digit) & 63;
                text.push(char::from(DIGITS[value as usize]));
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        let found = ["", "f", "fo", "foo", "foob", "fooba", "foobar"].map(|s| base64(s.as_bytes()));
        let expected = [
            "", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy",
        ];
        assert_eq!(found, expected);
    }

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
        let digits: Vec<u32> = (data.chars().filter(|c| *c != '='))
            .map(|c| match c {
                'A'..='Z' => c as u32 - 65,
                'a'..='z' => c as u32 - 71,
                '0'..='9' => c as u32 + 4,
                '+' => 62,
                _ => 63,
            })
            .collect();
        let mut file = Vec::new();
        for group in digits.chunks(4) {
            let bits = group
                .iter()
                .enumerate()
                .fold(0, |b, (k, d)| b | d << (18 - 6 * k));
            file.extend_from_slice(&u32::to_be_bytes(bits)[1..group.len()]);
        }
        let mut reader = png::Decoder::new(io::Cursor::new(file))
            .read_info()
            .unwrap();
        let mut found = vec![0; 18];
        let info = reader.next_frame(&mut found).unwrap();
        assert_eq!((info.width, info.height, found), (3, 2, rgb));
    }
}
