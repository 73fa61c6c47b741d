//! Tests of textures, with values from Mitsuba 3.9.1.

use super::*;

fn picture() -> Bitmap {
    let p = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.4, 0.6], [0.9, 0.1, 0.3], [0.5, 0.5, 0.0]];
    Bitmap { width: 3, height: 2, pixels: p.iter().map(|&c| Rgb::from(c)).collect() }
}

fn bitmap(filter: TexFilter, wrap: Wrap) -> Texture {
    let to_uv = Affine2::from_translation(Vec2::new(0.1, 0.05)) * Affine2::from_scale(Vec2::new(1.5, 0.8));
    Texture::Bitmap { image: 0, filter, wrap, to_uv }
}

/// Filter, wrap, uv, value, gradient of the luminance.
type Golden = (TexFilter, Wrap, [f32; 2], [f32; 3], [f32; 2]);

/// Mitsuba 3.9.1: `bitmap` with the picture above, raw, to_uv = translate(0.1, 0.05) scale(1.5, 0.8).
#[test]
fn bitmaps_agree_with_mitsuba() {
    use TexFilter::*;
    use Wrap::*;
    #[rustfmt::skip]
    let golden: [Golden; 17] = [
        (Nearest, Repeat, [0.45, 0.6], [0.5, 0.5, 0.0], [0.0, 0.0]),
        (Nearest, Repeat, [-0.7, 1.8], [1.0, 0.0, 0.0], [0.0, 0.0]),
        (Nearest, Mirror, [-0.7, 1.8], [0.5, 0.5, 0.0], [0.0, 0.0]),
        (Nearest, Clamp, [2.3, -1.4], [0.0, 0.0, 1.0], [0.0, 0.0]),
        (Bilinear, Repeat, [0.1, 0.1], [0.66, 0.268, 0.126], [1.6242, -0.01884]),
        (Bilinear, Repeat, [0.45, 0.6], [0.3192, 0.3178, 0.3924], [-0.82117, 0.39654]),
        (Bilinear, Repeat, [0.9, 0.95], [0.7176, 0.2296, 0.3036], [-0.07448, 0.54739]),
        (Bilinear, Repeat, [-0.7, 1.8], [0.4844, 0.2088, 0.3692], [0.13002, 0.38498]),
        (Bilinear, Repeat, [2.3, -1.4], [0.5376, 0.4084, 0.2172], [-0.52513, 0.49158]),
        (Bilinear, Mirror, [0.1, 0.1], [0.75, 0.25, 0.0], [2.2612, 0.0]),
        (Bilinear, Mirror, [0.45, 0.6], [0.3192, 0.3178, 0.3924], [-0.82117, 0.39654]),
        (Bilinear, Mirror, [0.9, 0.95], [0.84, 0.16, 0.255], [-0.80705, 0.0]),
        (Bilinear, Mirror, [-0.7, 1.8], [0.26, 0.26, 0.48], [0.0, -0.62679]),
        (Bilinear, Mirror, [2.3, -1.4], [0.795, 0.145, 0.345], [0.39298, 0.0]),
        (Bilinear, Clamp, [0.1, 0.1], [0.75, 0.25, 0.0], [2.2612, 0.0]),
        (Bilinear, Clamp, [0.9, 0.95], [0.5, 0.5, 0.0], [0.0, 0.0]),
        (Bilinear, Clamp, [-0.7, 1.8], [0.2, 0.4, 0.6], [0.0, 0.0]),
    ];
    for (filter, wrap, uv, value, slope) in golden {
        let textures = [bitmap(filter, wrap)];
        let images = [picture()];
        let t = Textures { textures: &textures, images: &images };
        let (v, g) = (t.eval(0, uv.into()), t.gradient(0, uv.into()));
        assert!((v - Rgb::from(value)).abs().max_element() < 2e-5, "{filter:?} {wrap:?} {uv:?}: {v}");
        assert!((g - Vec2::from(slope)).abs().max_element() < 5e-5, "{filter:?} {wrap:?} {uv:?}: {g}");
    }
}

#[test]
fn checks_agree_with_mitsuba() {
    let textures = [Texture::Checkerboard {
        color0: Color::Constant(Rgb::ONE),
        color1: Color::Constant(Rgb::ZERO),
        to_uv: Affine2::IDENTITY,
    }];
    let t = Textures { textures: &textures, images: &[] };
    // Mitsuba 3.9.1's `eval_1`; its `eval` gives the other colour.
    for (uv, value) in [
        ([0.25, 0.25], 0.0),
        ([0.75, 0.25], 1.0),
        ([0.25, 0.75], 1.0),
        ([0.75, 0.75], 0.0),
        ([1.25, 0.25], 0.0),
        ([-0.25, 0.25], 1.0),
        ([-0.25, -0.25], 0.0),
    ] {
        assert_eq!(t.eval_scalar(0, uv.into()), value, "{uv:?}");
        assert_eq!(t.eval(0, uv.into()), Rgb::splat(1.0 - value), "{uv:?}");
    }
    assert_eq!(t.mean(&Color::Texture(0)), Rgb::splat(0.5));
}

#[test]
fn scalars_of_bitmaps_are_luminance_and_of_colours_means() {
    let textures = [
        bitmap(TexFilter::Nearest, Wrap::Repeat),
        Texture::Checkerboard {
            color0: Color::Constant(Rgb::new(0.9, 0.3, 0.0)),
            color1: Color::Texture(0),
            to_uv: Affine2::IDENTITY,
        },
        Texture::Scale { texture: 0, factor: Rgb::splat(2.0) },
    ];
    let images = [picture()];
    let t = Textures { textures: &textures, images: &images };
    let red = Vec2::new(0.1, 0.1);
    assert!((t.eval_scalar(0, red) - 0.212_671).abs() < 1e-6);
    assert!((t.eval_scalar(1, Vec2::new(0.7, 0.1)) - 0.4).abs() < 1e-6);
    assert_eq!(t.eval_scalar(1, red), t.eval_scalar(0, red));
    assert_eq!(t.eval(2, red), Rgb::new(2.0, 0.0, 0.0));
    let mean = t.mean(&Color::Texture(2));
    assert!((mean - Rgb::new(2.6, 2.0, 1.9) / 3.0).abs().max_element() < 1e-6, "{mean}");
}

#[test]
fn odd_coordinates_and_empty_pictures_do_no_harm() {
    let textures = [
        bitmap(TexFilter::Bilinear, Wrap::Repeat),
        bitmap(TexFilter::Bilinear, Wrap::Mirror),
        bitmap(TexFilter::Bilinear, Wrap::Clamp),
        bitmap(TexFilter::Nearest, Wrap::Repeat),
        bitmap(TexFilter::Nearest, Wrap::Mirror),
        bitmap(TexFilter::Nearest, Wrap::Clamp),
    ];
    for image in [picture(), Bitmap::default()] {
        let images = [image];
        let t = Textures { textures: &textures, images: &images };
        for id in 0..textures.len() as u32 {
            for x in [0.0, -0.0, 1.0, -1e-9, 1e9, -3.4e38, f32::INFINITY, f32::NAN, 0.999_999_94] {
                for uv in [Vec2::new(x, 0.3), Vec2::new(0.3, x), Vec2::splat(x)] {
                    let v = t.eval(id, uv);
                    assert!(v.is_finite() && v.min_element() >= 0.0 && v.max_element() <= 1.0 + 1e-6);
                    assert!(t.gradient(id, uv).is_finite());
                }
            }
        }
    }
}
