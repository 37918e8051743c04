//! A canvas of pixels on either back end of plotters: lines, bars, words, and marks that tell methods apart.
//!
//! Colours are those of Okabe & Ito (2008, "Color Universal Design"), which colour-blind readers tell apart; every
//! colour comes with a mark of its own, so that the figures also read in grey. Words are set in DejaVu Sans, cut down
//! to Latin and Greek, from this file's folder (licence beside it): plotters has no font without one.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::sync::OnceLock;

pub(super) const INK: RGBColor = RGBColor(28, 28, 28);
pub(super) const FAINT: RGBColor = RGBColor(215, 215, 212);
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);

/// Okabe & Ito's colours, without the yellow that vanishes on white.
const PALETTE: [RGBColor; 7] = [
    BLUE,
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    ORANGE,
    RGBColor(86, 180, 233),
    RGBColor(60, 60, 60),
];

/// Corners of each mark, in units of its radius; the first is a circle.
const SHAPES: [&[(f64, f64)]; 6] = [
    &[],
    &[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
    &[(0.0, -1.15), (1.05, 0.75), (-1.05, 0.75)],
    &[(0.0, -1.25), (1.0, 0.0), (0.0, 1.25), (-1.0, 0.0)],
    &[(0.0, 1.15), (1.05, -0.75), (-1.05, -0.75)],
    &[(-1.3, 0.5), (-1.3, -0.5), (1.3, -0.5), (1.3, 0.5)],
];

const FONT: &str = "sans-serif";

/// Which end, or the middle, of the words is at their point.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

/// Something that can be drawn on any back end.
pub(super) trait Picture {
    /// Width and height, pixels.
    fn size(&self) -> (u32, u32);

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn;
}

/// Nothing, or why a figure could not be drawn.
pub(super) type Drawn = Result<(), String>;

/// Where a picture is drawn; all lengths are pixels of the unscaled picture, y grows downwards.
pub(super) struct Canvas<B: DrawingBackend> {
    area: DrawingArea<B, Shift>,
    scale: f64,
    /// How far below their point words are put, in units of their size.
    sink: f64,
}

/// The bitmap back end centres the box of a word, descenders included; SVG viewers centre its small letters.
const BITMAP_SINK: f64 = 0.12;

/// The picture as an SVG document.
pub(super) fn svg(picture: &impl Picture) -> Result<String, String> {
    let mut document = String::new();
    draw(picture, SVGBackend::with_string(&mut document, picture.size()), 1.0, 0.0)?;
    Ok(document)
}

/// The picture as a PNG file of `scale` times its size.
pub(super) fn png(picture: &impl Picture, scale: u32) -> Result<Vec<u8>, String> {
    let (width, height) = (picture.size().0 * scale, picture.size().1 * scale);
    let mut pixels = vec![0; (width * height * 3) as usize];
    draw(picture, BitMapBackend::with_buffer(&mut pixels, (width, height)), f64::from(scale), BITMAP_SINK)?;
    let mut file = Vec::new();
    // Flat colours are smaller without a filter.
    let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::NoFilter);
    image::ImageEncoder::write_image(encoder, &pixels, width, height, image::ColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    Ok(file)
}

fn draw<B: DrawingBackend>(picture: &impl Picture, backend: B, scale: f64, sink: f64) -> Drawn {
    register_font()?;
    let canvas = Canvas { area: backend.into_drawing_area(), scale, sink };
    canvas.area.fill(&WHITE).map_err(|e| e.to_string())?;
    picture.draw(&canvas)?;
    canvas.area.present().map_err(|e| e.to_string())
}

fn register_font() -> Drawn {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    let bytes = include_bytes!("font/dejavu-sans-subset.ttf");
    if *REGISTERED.get_or_init(|| plotters::style::register_font(FONT, FontStyle::Normal, bytes).is_ok()) {
        Ok(())
    } else {
        Err("the built-in font is damaged".to_owned())
    }
}

impl<B: DrawingBackend> Canvas<B> {
    fn at(&self, (x, y): (f64, f64)) -> (i32, i32) {
        ((x * self.scale).round() as i32, (y * self.scale).round() as i32)
    }

    fn stroke(&self, width: f64) -> u32 {
        (width * self.scale).round().max(1.0) as u32
    }

    fn put<E>(&self, element: E) -> Drawn
    where
        for<'p> &'p E: plotters::element::PointCollection<'p, (i32, i32)>,
        E: plotters::element::Drawable<B>,
    {
        self.area.draw(&element).map_err(|e| e.to_string())
    }

    pub(super) fn line(&self, from: (f64, f64), to: (f64, f64), colour: RGBColor, width: f64) -> Drawn {
        self.put(PathElement::new(vec![self.at(from), self.at(to)], colour.stroke_width(self.stroke(width))))
    }

    /// A filled bar, with an outline where one is asked for.
    pub(super) fn bar(&self, corner: (f64, f64), opposite: (f64, f64), colour: RGBColor, outline: bool) -> Drawn {
        let corners = [self.at(corner), self.at(opposite)];
        self.put(Rectangle::new(corners, colour.filled()))?;
        if outline {
            self.put(Rectangle::new(corners, INK.stroke_width(self.stroke(1.0))))?;
        }
        Ok(())
    }

    /// Words, centred vertically at `at`.
    pub(super) fn words(&self, words: &str, at: (f64, f64), size: f64, anchor: Anchor) -> Drawn {
        let side = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let font = (FONT, size * self.scale).into_font().color(&INK).pos(Pos::new(side, VPos::Center));
        self.put(Text::new(words.to_owned(), self.at((at.0, at.1 + self.sink * size)), font))
    }

    /// The mark of the `index`-th method: no two of the first 42 are the same.
    pub(super) fn mark(&self, index: usize, at: (f64, f64), radius: f64) -> Drawn {
        let colour = PALETTE[index % PALETTE.len()].mix(0.85);
        let shape = SHAPES[(index + index / (PALETTE.len() * SHAPES.len())) % SHAPES.len()];
        if shape.is_empty() {
            return self.put(Circle::new(self.at(at), self.stroke(radius), colour.filled()));
        }
        let corners: Vec<(i32, i32)> =
            shape.iter().map(|(x, y)| self.at((at.0 + radius * x, at.1 + radius * y))).collect();
        self.put(Polygon::new(corners, colour.filled()))
    }

    /// An open circle.
    pub(super) fn ring(&self, at: (f64, f64), radius: f64) -> Drawn {
        self.put(Circle::new(self.at(at), self.stroke(radius), INK.stroke_width(self.stroke(1.0))))
    }

    /// A diamond that stands out on a bar.
    pub(super) fn diamond(&self, at: (f64, f64), radius: f64) -> Drawn {
        let corners: Vec<(i32, i32)> =
            SHAPES[3].iter().map(|(x, y)| self.at((at.0 + radius * x, at.1 + radius * y))).collect();
        self.put(Polygon::new(corners.clone(), WHITE.filled()))?;
        let closed: Vec<(i32, i32)> = corners.iter().chain(corners.first()).copied().collect();
        self.put(PathElement::new(closed, INK.stroke_width(self.stroke(1.5))))
    }

    /// A line through points.
    pub(super) fn path(&self, points: &[(f64, f64)], colour: RGBColor, width: f64) -> Drawn {
        let points: Vec<(i32, i32)> = points.iter().map(|p| self.at(*p)).collect();
        self.put(PathElement::new(points, colour.stroke_width(self.stroke(width))))
    }
}

/// The colour of the mark of the `index`-th method.
pub(super) fn colour(index: usize) -> RGBColor {
    PALETTE[index % PALETTE.len()]
}

/// Width of the words in pixels, for margins.
pub(super) fn width(words: &str, size: f64) -> Result<f64, String> {
    register_font()?;
    let (width, _) = (FONT, size).into_font().box_size(words).map_err(|e| e.to_string())?;
    Ok(f64::from(width))
}
