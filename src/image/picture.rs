//! A picture in memory: linear RGB, with the place it has in a larger frame.

use crate::math::Rgb;

/// A rectangle of pixels; (0, 0) is the upper left pixel of the full frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// First column; may be negative in files of other programs.
    pub x: i32,
    /// First row.
    pub y: i32,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Window {
    /// The window of a whole frame.
    pub fn full(width: usize, height: usize) -> Self {
        Window { x: 0, y: 0, width, height }
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width * self.height
    }

    /// Whether `inner` lies in this window.
    pub fn contains(&self, inner: &Window) -> bool {
        let end = |start: i32, length: usize| start as i64 + length as i64;
        inner.x >= self.x
            && inner.y >= self.y
            && end(inner.x, inner.width) <= end(self.x, self.width)
            && end(inner.y, inner.height) <= end(self.y, self.height)
    }
}

/// A picture in linear RGB, row 0 on top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Where the pixels lie in the full frame (EXR: the data window, relative to the display window).
    pub window: Window,
    /// Width and height of the full frame (EXR: the display window).
    pub frame: (usize, usize),
    /// `window.area()` pixels, row by row.
    pub pixels: Vec<Rgb>,
    /// The channel `mask`, if the file has one: which pixels count.
    pub mask: Option<Vec<bool>>,
}

impl Picture {
    /// A picture that fills its frame.
    ///
    /// # Panics
    /// If there are not `width * height` pixels.
    pub fn new(width: usize, height: usize, pixels: Vec<Rgb>) -> Self {
        assert_eq!(pixels.len(), width * height, "number of pixels");
        Picture { window: Window::full(width, height), frame: (width, height), pixels, mask: None }
    }

    /// Width in pixels of what is stored.
    pub fn width(&self) -> usize {
        self.window.width
    }

    /// Height in pixels of what is stored.
    pub fn height(&self) -> usize {
        self.window.height
    }

    /// The part of the picture inside `window`, or `None` if it does not cover that window.
    pub fn cropped(&self, window: Window) -> Option<Picture> {
        if !self.window.contains(&window) {
            return None;
        }
        let column = (window.x - self.window.x) as usize;
        let row = (window.y - self.window.y) as usize;
        let ranges = || {
            (row..row + window.height).map(|y| {
                let start = y * self.window.width + column;
                start..start + window.width
            })
        };
        Some(Picture {
            window,
            frame: self.frame,
            pixels: ranges().flat_map(|r| &self.pixels[r]).copied().collect(),
            mask: self.mask.as_ref().map(|m| ranges().flat_map(|r| &m[r]).copied().collect()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cropping_takes_the_right_pixels_and_refuses_what_is_not_there() {
        let mut picture = Picture::new(4, 3, (0..12).map(|i| Rgb::splat(i as f32)).collect());
        picture.window.x = 10;
        picture.mask = Some((0..12).map(|i| i == 6).collect());
        let window = Window { x: 11, y: 1, width: 2, height: 2 };
        let part = picture.cropped(window).unwrap();
        let values: Vec<f32> = part.pixels.iter().map(|p| p.x).collect();
        assert_eq!(values, [5.0, 6.0, 9.0, 10.0]);
        assert_eq!(part.mask.unwrap(), [false, true, false, false]);
        for bad in [Window { x: 9, ..window }, Window { x: 13, ..window }, Window { y: 2, ..window }] {
            assert!(picture.cropped(bad).is_none(), "{bad:?}");
        }
    }
}
