//! Tests of reading pictures.

use super::*;
use crate::image::exr_file::{ExrImage, Precision};
use crate::image::{Window, exr_file, png_file};
use image::codecs::{bmp::BmpEncoder, hdr::HdrEncoder, jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

const PATH: &str = "picture";

fn read(bytes: &[u8], srgb: bool) -> Picture {
    decode(Path::new(PATH), bytes, srgb).unwrap()
}

fn png(data: &[u8], width: u32, height: u32, color: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(data, width, height, color).unwrap();
    bytes
}

/// One file of each kind, 8 x 8 pixels.
fn one_of_each() -> Vec<(&'static str, Vec<u8>)> {
    let codes: Vec<u8> = (0..192).map(|i| (i * 37 % 256) as u8).collect();
    let floats: Vec<Rgb> = codes.chunks(3).map(|c| Rgb::new(c[0] as f32, c[1] as f32, c[2] as f32)).collect();
    let mut bmp = Vec::new();
    BmpEncoder::new(&mut bmp).write_image(&codes, 8, 8, ExtendedColorType::Rgb8).unwrap();
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 95).write_image(&codes, 8, 8, ExtendedColorType::Rgb8).unwrap();
    let mut hdr = Vec::new();
    let raw: Vec<u8> = floats.iter().flat_map(|p| p.to_array()).flat_map(f32::to_ne_bytes).collect();
    HdrEncoder::new(&mut hdr).write_image(&raw, 8, 8, ExtendedColorType::Rgb32F).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.exr");
    let mut image = ExrImage::new(Window::full(8, 8), (8, 8));
    image.add_layer("", "RGB", Precision::Half, &floats);
    exr_file::write_exr(&path, &image).unwrap();
    let mut pfm = b"PF 8 8 -1\n".to_vec();
    pfm.extend(&raw);
    vec![
        ("png", png(&codes, 8, 8, ExtendedColorType::Rgb8)),
        ("bmp", bmp),
        ("jpeg", jpeg),
        ("hdr", hdr),
        ("exr", std::fs::read(&path).unwrap()),
        ("pfm", pfm),
    ]
}

#[test]
fn png_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.png");
    let codes = [0u8, 1, 40, 128, 200, 255];
    let pixels: Vec<Rgb> = codes.iter().map(|&c| Rgb::splat(srgb::table_u8(true)[c as usize])).collect();
    png_file::write_png(&path, 3, 2, &pixels, 0.0).unwrap();
    let picture = read_image(&path).unwrap();
    assert_eq!((picture.width(), picture.height()), (3, 2));
    assert_eq!(picture.pixels, pixels);
    // One stop brighter: twice the linear value.
    png_file::write_png(&path, 1, 1, &[Rgb::splat(0.25)], 1.0).unwrap();
    assert!((read_image(&path).unwrap().pixels[0].x - 0.5).abs() < 0.005);
    assert!(png_file::write_png(&path, 2, 2, &pixels, 0.0).is_err());
    assert!(png_file::write_png(&path, 0, 0, &[], 0.0).is_err());
    assert_eq!(read_image(&path).unwrap().width(), 1, "failed writes leave the file alone");
}

#[test]
fn all_png_colour_types() {
    let t = srgb::table_u8(true);
    let rgba = png(&[10, 20, 30, 0, 40, 50, 60, 255], 2, 1, ExtendedColorType::Rgba8);
    assert_eq!(read(&rgba, true).pixels, [Rgb::new(t[10], t[20], t[30]), Rgb::new(t[40], t[50], t[60])]);
    let grey_alpha = png(&[100, 3], 1, 1, ExtendedColorType::La8);
    assert_eq!(read(&grey_alpha, true).pixels, [Rgb::splat(t[100])]);
    let grey = png(&[255, 51], 2, 1, ExtendedColorType::L8);
    assert_eq!(read(&grey, false).pixels, [Rgb::ONE, Rgb::splat(0.2)]);

    let sixteen: Vec<u8> = [0u16, 32768, 65535].iter().flat_map(|v| v.to_ne_bytes()).collect();
    let linear = read(&png(&sixteen, 1, 1, ExtendedColorType::Rgb16), false).pixels[0];
    assert!((linear - Rgb::new(0.0, 0.500_007_6, 1.0)).abs().max_element() < 1e-6);
    let decoded = read(&png(&sixteen, 3, 1, ExtendedColorType::L16), true).pixels[1].x;
    assert!((decoded - 0.214_048_1).abs() < 1e-5, "{decoded}");
}

#[test]
fn palette_png_is_expanded() {
    // 2 x 1 pixels, palette of two colours, 1 bit per pixel; data 0b01000000 stored without compression.
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        let body = [kind.as_slice(), data].concat();
        let mut crc = flate2::Crc::new();
        crc.update(&body);
        bytes.extend((data.len() as u32).to_be_bytes());
        bytes.extend(body);
        bytes.extend(crc.sum().to_be_bytes());
    };
    chunk(b"IHDR", &[0, 0, 0, 2, 0, 0, 0, 1, 1, 3, 0, 0, 0]);
    chunk(b"PLTE", &[255, 0, 0, 0, 0, 255]);
    chunk(b"IDAT", &[0x78, 1, 1, 2, 0, 0xfd, 0xff, 0, 0x40, 0, 0x42, 0, 0x41]);
    chunk(b"IEND", &[]);
    assert_eq!(read(&bytes, true).pixels, [Rgb::X, Rgb::Z]);
}

#[test]
fn every_kind_is_told_by_content() {
    let files = one_of_each();
    let png = read(&files[0].1, true);
    for (kind, bytes) in &files {
        let picture = read(bytes, true);
        assert_eq!((picture.width(), picture.height()), (8, 8), "{kind}");
        let at = |i: usize| picture.pixels[i];
        match *kind {
            "bmp" => assert_eq!(picture.pixels, png.pixels),
            // Lossy, but the mean survives.
            "jpeg" => {
                let mean = |p: &Picture| p.pixels.iter().map(|c| c.element_sum()).sum::<f32>();
                assert!((mean(&picture) / mean(&png) - 1.0).abs() < 0.05);
            }
            "hdr" => assert!((at(1) - Rgb::new(111.0, 148.0, 185.0)).abs().max_element() < 1.0),
            "exr" => assert_eq!(at(1), Rgb::new(111.0, 148.0, 185.0)),
            "pfm" => assert_eq!(at(7 * 8 + 1), Rgb::new(111.0, 148.0, 185.0)),
            _ => {}
        }
    }
}

#[test]
fn damaged_files_are_errors_or_pictures_but_never_panic() {
    for (kind, bytes) in one_of_each() {
        for end in 0..bytes.len() {
            let _ = decode(Path::new(PATH), &bytes[..end], true);
        }
        assert!(decode(Path::new(PATH), &bytes[..bytes.len() / 4], true).is_err(), "{kind}");
        let mut state = 1u64;
        for round in 0..500u64 {
            let mut broken = bytes.clone();
            for _ in 0..1 + round % 3 {
                state = crate::math::sampler::hash(state, round);
                let at = (state >> 8) as usize % broken.len();
                broken[at] = state as u8;
            }
            let _ = decode(Path::new(PATH), &broken, true);
        }
    }
}

#[test]
fn hostile_and_foreign_files_are_errors() {
    // A PNG header that claims 2^31 - 1 pixels each way.
    let mut huge = png(&[0; 3], 1, 1, ExtendedColorType::Rgb8);
    huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let mut crc = flate2::Crc::new();
    crc.update(&huge[12..29]);
    huge[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    assert!(decode(Path::new(PATH), &huge, true).is_err());
    for bytes in [b"".as_slice(), b"BM", b"P3 1 1 255", b"<scene/>", b"\x89PNG", b"#?RGBE\n\n-Y 99999999 +X 99999999\n"]
    {
        let error = decode(Path::new(PATH), bytes, true).unwrap_err();
        assert!(error.to_string().starts_with(PATH), "{error}");
    }
    assert!(matches!(read_image(Path::new("/no/such/file")), Err(ImageFileError::Io { .. })));
}

#[cfg(unix)]
#[test]
fn devices_are_refused_since_they_may_never_end() {
    let error = read_image(Path::new("/dev/zero")).unwrap_err();
    assert!(error.to_string().contains("not a file"), "{error}");
}
