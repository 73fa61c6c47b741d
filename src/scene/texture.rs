//! Bitmaps and textures: functions of uv that materials and lamps refer to.

use super::description::{ImageId, TextureId};
use crate::math::{Affine2, Rgb, Vec2};

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

/// What lies outside [0,1]^2.
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
    /// 2 x 2 checks per unit square: `color0` where both halves agree.
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

/// A scalar parameter: constant or textured (mean of the channels).
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
        let _ = (id, uv);
        todo!("helper bsdf")
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
            Scalar::Texture(id) => self.eval(*id, uv).element_sum() / 3.0,
        }
    }

    /// Mean of a colour over its picture (unit square); for light selection and `info`.
    pub fn mean(&self, color: &Color) -> Rgb {
        let _ = color;
        todo!("helper bsdf")
    }
}
