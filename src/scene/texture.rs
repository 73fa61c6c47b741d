//! Bitmaps and textures: functions of uv that materials and lamps refer to.
//!
//! A picture covers the unit square of uv with row 0 at v = 0; the centre of texel (i, j) lies at
//! ((i + 1/2) / width, (j + 1/2) / height). Conventions agree with Mitsuba 3 (tests hold values taken from it).
//! Coordinates that are not finite count as 0. Not handled: filtering over a footprint (mip maps).

use super::description::{ImageId, TextureId};
use crate::math::{Affine2, Rgb, Vec2, luminance};

/// A picture in linear RGB, row 0 on top (v = 0).
#[derive(Clone, Debug, Default)]
pub struct Bitmap {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major pixels, `width * height` of them.
    pub pixels: Vec<Rgb>,
}

/// Interpolation between texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexFilter {
    /// Nearest texel.
    Nearest,
    /// Bilinear between texel centres.
    Bilinear,
}

/// What lies outside the unit square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Periodic.
    Repeat,
    /// Periodic, every second tile mirrored.
    Mirror,
    /// The border goes on.
    Clamp,
}

/// A colour that varies over a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// A picture.
    Bitmap {
        /// The picture.
        image: ImageId,
        /// Interpolation.
        filter: TexFilter,
        /// Outside of the unit square.
        wrap: Wrap,
        /// Surface uv to picture uv.
        to_uv: Affine2,
    },
    /// 2 x 2 checks per unit square: as a colour `color0` where u and v lie in the same half of their period, else
    /// `color1`; as a scalar (roughness, opacity ...) the other way round. That is Mitsuba 3.9.1's inconsistency, kept so that
    /// its files look the same.
    Checkerboard {
        /// First colour.
        color0: Color,
        /// Second colour.
        color1: Color,
        /// Surface uv to pattern uv.
        to_uv: Affine2,
    },
    /// A texture times a constant.
    Scale {
        /// The texture.
        texture: TextureId,
        /// The factor.
        factor: Rgb,
    },
}

/// A colour parameter: constant or textured.
#[derive(Clone, Debug, PartialEq)]
pub enum Color {
    /// The same everywhere.
    Constant(Rgb),
    /// Varies.
    Texture(TextureId),
}

/// A scalar parameter: constant or textured (luminance of a bitmap, mean of the channels of any other colour).
#[derive(Clone, Debug, PartialEq)]
pub enum Scalar {
    /// The same everywhere.
    Constant(f32),
    /// Varies.
    Texture(TextureId),
}

/// Textures with their pictures: what is needed to evaluate a [`Color`] or [`Scalar`].
#[derive(Clone, Copy, Debug)]
pub struct Textures<'a> {
    /// All textures.
    pub textures: &'a [Texture],
    /// All pictures.
    pub images: &'a [Bitmap],
}

impl Textures<'_> {
    /// Value of texture `id` at `uv`.
    pub fn eval(&self, id: TextureId, uv: Vec2) -> Rgb {
        match &self.textures[id as usize] {
            Texture::Bitmap { image, filter, wrap, to_uv } => {
                self.images[*image as usize].eval(to_uv.transform_point2(uv), *filter, *wrap)
            }
            Texture::Checkerboard { color0, color1, to_uv } => self.color(check(*to_uv, uv, [color0, color1]), uv),
            Texture::Scale { texture, factor } => self.eval(*texture, uv) * *factor,
        }
    }

    /// Value of texture `id` at `uv` as a scalar, see [`Scalar`].
    pub fn eval_scalar(&self, id: TextureId, uv: Vec2) -> f32 {
        match &self.textures[id as usize] {
            Texture::Bitmap { .. } => luminance(self.eval(id, uv)),
            Texture::Checkerboard { color0, color1, to_uv } => match check(*to_uv, uv, [color1, color0]) {
                Color::Constant(c) => mean_channel(*c),
                Color::Texture(id) => self.eval_scalar(*id, uv),
            },
            Texture::Scale { texture, factor } => self.eval_scalar(*texture, uv) * mean_channel(*factor),
        }
    }

    /// Derivatives by u and v of [`Self::eval_scalar`], for bump maps. Bilinear pictures have the derivative of their
    /// interpolant; nearest-texel pictures and checks are piecewise constant, so theirs is 0.
    pub fn gradient(&self, id: TextureId, uv: Vec2) -> Vec2 {
        match &self.textures[id as usize] {
            Texture::Bitmap { filter: TexFilter::Nearest, .. } => Vec2::ZERO,
            Texture::Bitmap { image, wrap, to_uv, .. } => {
                let slope = self.images[*image as usize].slope(to_uv.transform_point2(uv), *wrap);
                to_uv.matrix2.transpose() * slope
            }
            Texture::Checkerboard { color0, color1, to_uv } => match check(*to_uv, uv, [color1, color0]) {
                Color::Constant(_) => Vec2::ZERO,
                Color::Texture(id) => self.gradient(*id, uv),
            },
            Texture::Scale { texture, factor } => self.gradient(*texture, uv) * mean_channel(*factor),
        }
    }

    /// Value of a colour at `uv`.
    pub fn color(&self, color: &Color, uv: Vec2) -> Rgb {
        match color {
            Color::Constant(c) => *c,
            Color::Texture(id) => self.eval(*id, uv),
        }
    }

    /// Value of a scalar at `uv`.
    pub fn scalar(&self, scalar: &Scalar, uv: Vec2) -> f32 {
        match scalar {
            Scalar::Constant(c) => *c,
            Scalar::Texture(id) => self.eval_scalar(*id, uv),
        }
    }

    /// Mean of a colour over its picture (unit square); for light selection and `info`. `to_uv` is ignored: the mean is
    /// that of one whole period. Walks over all pixels.
    pub fn mean(&self, color: &Color) -> Rgb {
        let id = match color {
            Color::Constant(c) => return *c,
            Color::Texture(id) => *id,
        };
        match &self.textures[id as usize] {
            Texture::Bitmap { image, .. } => self.images[*image as usize].mean(),
            Texture::Checkerboard { color0, color1, .. } => 0.5 * (self.mean(color0) + self.mean(color1)),
            Texture::Scale { texture, factor } => self.mean(&Color::Texture(*texture)) * *factor,
        }
    }
}

/// The first of two colours where the coordinates of a checkerboard lie in the same half of their period, else the second.
fn check(to_uv: Affine2, uv: Vec2, [same, other]: [&Color; 2]) -> &Color {
    let p = to_uv.transform_point2(uv);
    let upper = |x: f32| x - x.floor() > 0.5;
    if upper(p.x) == upper(p.y) { same } else { other }
}

fn mean_channel(c: Rgb) -> f32 {
    c.element_sum() / 3.0
}

impl Bitmap {
    /// Value at the picture coordinates `p`; black if there are no pixels.
    fn eval(&self, p: Vec2, filter: TexFilter, wrap: Wrap) -> Rgb {
        if self.pixels.is_empty() {
            return Rgb::ZERO;
        }
        match filter {
            TexFilter::Nearest => {
                let x = wrap.reduce(p.x) * self.width as f32;
                let y = wrap.reduce(p.y) * self.height as f32;
                self.texel(x.floor() as i32, y.floor() as i32, wrap)
            }
            TexFilter::Bilinear => {
                let (c, wx, wy) = self.corners(p, wrap);
                (c[0] * (1.0 - wx) + c[1] * wx) * (1.0 - wy) + (c[2] * (1.0 - wx) + c[3] * wx) * wy
            }
        }
    }

    /// Derivatives of the luminance of the bilinear interpolant by the two picture coordinates.
    fn slope(&self, p: Vec2, wrap: Wrap) -> Vec2 {
        if self.pixels.is_empty() {
            return Vec2::ZERO;
        }
        let (c, wx, wy) = self.corners(p, wrap);
        let dx = (c[1] - c[0]) * (1.0 - wy) + (c[3] - c[2]) * wy;
        let dy = (c[2] - c[0]) * (1.0 - wx) + (c[3] - c[1]) * wx;
        Vec2::new(luminance(dx) * self.width as f32, luminance(dy) * self.height as f32)
    }

    /// The four texels around `p` (left to right, then the next row) and the weights of the right and lower ones.
    fn corners(&self, p: Vec2, wrap: Wrap) -> ([Rgb; 4], f32, f32) {
        let x = wrap.reduce(p.x) * self.width as f32 - 0.5;
        let y = wrap.reduce(p.y) * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (i, j) = (x0 as i32, y0 as i32);
        let corners = [
            self.texel(i, j, wrap),
            self.texel(i + 1, j, wrap),
            self.texel(i, j + 1, wrap),
            self.texel(i + 1, j + 1, wrap),
        ];
        (corners, x - x0, y - y0)
    }

    fn texel(&self, i: i32, j: i32, wrap: Wrap) -> Rgb {
        self.pixels[wrap.index(j, self.height) * self.width + wrap.index(i, self.width)]
    }

    fn mean(&self) -> Rgb {
        // In double precision: millions of texels would lose digits in a plain f32 sum.
        let sum = self.pixels.iter().fold([0f64; 3], |s, p| [s[0] + p.x as f64, s[1] + p.y as f64, s[2] + p.z as f64]);
        let n = self.pixels.len().max(1) as f64;
        Rgb::new((sum[0] / n) as f32, (sum[1] / n) as f32, (sum[2] / n) as f32)
    }
}

impl Wrap {
    /// A coordinate with the same value under this rule that is small enough for integer texel indices.
    fn reduce(self, x: f32) -> f32 {
        if !x.is_finite() {
            return 0.0;
        }
        match self {
            Wrap::Repeat => x - x.floor(),
            Wrap::Mirror => x - 2.0 * (0.5 * x).floor(),
            Wrap::Clamp => x.clamp(-1.0, 2.0),
        }
    }

    /// Texel index in 0..n for any index.
    fn index(self, i: i32, n: usize) -> usize {
        let n = n as i32;
        let i = match self {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Mirror => {
                let i = i.rem_euclid(2 * n);
                if i < n { i } else { 2 * n - 1 - i }
            }
            Wrap::Clamp => i.clamp(0, n - 1),
        };
        i as usize
    }
}

#[cfg(test)]
mod tests;
