//! Tests of writing and reading OpenEXR.

use exr::image::read::image::ReadLayers as _;
use exr::image::read::layers::ReadChannels as _;

use super::*;
use crate::image::{exr_read, read_image};

/// A crop of 3 x 2 pixels out of 10 x 8, with odd values in it.
fn sample() -> ExrImage {
    let window = Window { x: 4, y: 5, width: 3, height: 2 };
    let mut image = ExrImage::new(window, (10, 8));
    let rgb: Vec<Vec3> = (0..6).map(|i| Vec3::new(i as f32 / 3.0, 1e9, -0.1 * i as f32)).collect();
    image.add_layer("", "RGB", Precision::Float, &rgb);
    image.add_layer("albedo", "RGB", Precision::Half, &[Vec3::splat(0.1); 6]);
    image.add_layer("normal", "XYZ", Precision::Float, &[Vec3::Z; 6]);
    image.add_channel("depth", "Z", Precision::Float, vec![f32::INFINITY; 6]);
    image.add_attribute("dualuxSeed", Attribute::Int(7));
    image.add_attribute("dualuxBigSeed", Attribute::Int(1 << 40));
    image.add_attribute("dualuxCommand", Attribute::Text("dualux render süß.xml\0x".into()));
    image.add_attribute("dualuxSeconds", Attribute::Float(1.5));
    image
}

fn round_trip(image: &ExrImage) -> crate::image::Picture {
    exr_read::decode(Path::new("x.exr"), &encode(image).unwrap()).unwrap()
}

#[test]
fn picture_and_windows_come_back_exactly() {
    for compression in [ExrCompression::Zip, ExrCompression::None] {
        let mut image = sample();
        image.compression = compression;
        image.channels[0].values[1] = f32::NAN;
        image.channels[1].values[2] = f32::NEG_INFINITY;
        let read = round_trip(&image);
        assert_eq!(read.window, image.window);
        assert_eq!(read.frame, (10, 8));
        assert!(read.mask.is_none());
        for (i, p) in read.pixels.iter().enumerate() {
            for c in 0..3 {
                assert_eq!(p[c].to_bits(), image.channels[c].values[i].to_bits(), "pixel {i}, channel {c}");
            }
        }
    }
}

#[test]
fn layers_and_attributes_are_in_the_first_part() {
    let bytes = encode(&sample()).unwrap();
    let file = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .unwrap();
    assert_eq!(file.layer_data.len(), 1);
    let list = &file.layer_data[0].channel_data.list;
    let names: Vec<String> = list.iter().map(|c| c.name.to_string()).collect();
    let expected = ["B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "depth.Z", "normal.X", "normal.Y", "normal.Z"];
    assert_eq!(names, expected);
    assert!(matches!(list[3].sample_data, FlatSamples::F16(_)));
    let FlatSamples::F32(depth) = &list[6].sample_data else { panic!("depth must be f32") };
    assert!(depth.iter().all(|d| *d == f32::INFINITY));

    let find = |name: &str| file.layer_data[0].attributes.other.get(&text(name)).unwrap().clone();
    assert_eq!(find("dualuxSeed"), AttributeValue::I32(7));
    assert_eq!(find("dualuxBigSeed"), AttributeValue::Text(text("1099511627776")));
    assert_eq!(find("dualuxSeconds"), AttributeValue::F32(1.5));
    let AttributeValue::Text(command) = find("dualuxCommand") else { panic!("command must be text") };
    assert_eq!(command.as_slice(), "dualux render süß.xml x".as_bytes());
}

#[test]
fn half_precision_rounds() {
    let mut image = ExrImage::new(Window::full(2, 1), (2, 1));
    image.add_layer("", "RGB", Precision::Half, &[Vec3::splat(0.1), Vec3::splat(1e6)]);
    let read = round_trip(&image);
    assert!(read.pixels[0].x != 0.1 && (read.pixels[0].x - 0.1).abs() < 1e-4);
    assert_eq!(read.pixels[1].x, f32::INFINITY);
}

#[test]
fn mask_grey_and_named_layers_are_found() {
    let mut image = ExrImage::new(Window::full(2, 1), (2, 1));
    image.add_layer("", "RGB", Precision::Float, &[Vec3::X, Vec3::Y]);
    image.add_channel("", "mask", Precision::Half, vec![0.0, 1.0]);
    assert_eq!(round_trip(&image).mask.unwrap(), [false, true]);

    let mut grey = ExrImage::new(Window::full(2, 1), (2, 1));
    grey.add_channel("", "Y", Precision::Float, vec![0.25, 4.0]);
    grey.add_layer("albedo", "RGB", Precision::Float, &[Vec3::ONE; 2]);
    assert_eq!(round_trip(&grey).pixels, [Vec3::splat(0.25), Vec3::splat(4.0)]);

    let mut layer = ExrImage::new(Window::full(1, 1), (1, 1));
    layer.add_channel("a", "R", Precision::Float, vec![9.0]);
    layer.add_layer("view.combined", "RGB", Precision::Float, &[Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(round_trip(&layer).pixels, [Vec3::new(1.0, 2.0, 3.0)]);

    let mut none = ExrImage::new(Window::full(1, 1), (1, 1));
    none.add_channel("light0", "", Precision::Float, vec![1.0]);
    let error = exr_read::decode(Path::new("x.exr"), &encode(&none).unwrap()).unwrap_err();
    assert!(error.to_string().contains("light0"), "{error}");
}

#[test]
fn nonsense_is_refused_and_the_old_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.exr");
    write_exr(&path, &sample()).unwrap();
    let before = std::fs::read(&path).unwrap();
    let mut wrong = Vec::new();
    let mut add = |change: fn(&mut ExrImage)| {
        let mut image = sample();
        change(&mut image);
        wrong.push(image);
    };
    add(|i| i.channels[0].values.truncate(5));
    add(|i| i.channels[0].name = "G".into());
    add(|i| i.channels[0].name.clear());
    add(|i| i.channels.clear());
    add(|i| i.window.width = 0);
    add(|i| i.attributes[0].0.clear());
    for image in &wrong {
        assert!(write_exr(&path, image).is_err());
    }
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(read_image(&path).unwrap().frame, (10, 8));
}

#[test]
fn hostile_sizes_are_refused_before_memory_is_reserved() {
    // The data window attribute of a valid file, enlarged to 2^30 x 2^30 pixels.
    let mut bytes = encode(&sample()).unwrap();
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    bytes[at + 8..at + 12].copy_from_slice(&((1i32 << 29) - 1).to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&((1i32 << 29) - 1).to_le_bytes());
    let error = exr_read::decode(Path::new("x.exr"), &bytes).unwrap_err();
    assert!(matches!(error, ImageFileError::TooLarge { .. } | ImageFileError::Format { .. }), "{error}");
}

#[test]
fn parts_tiles_integers_and_other_compressions_are_read() {
    use exr::compression::Compression;
    let part = |name: &str, prefix: &str, compression, blocks, samples: FlatSamples| Part {
        channel_data: AnyChannels::sort(
            ["R", "G", "B"].iter().map(|c| AnyChannel::new(text(&format!("{prefix}{c}")), samples.clone())).collect(),
        ),
        attributes: LayerAttributes::named(text(name)),
        size: Vec2(5, 3),
        encoding: Encoding { compression, blocks, line_order: LineOrder::Increasing },
    };
    let decoded = |parts: Vec<Part<AnyChannels<FlatSamples>>>| {
        let file = Image::from_layers(ImageAttributes::new(IntegerBounds::new((0, 0), (5, 3))), parts);
        let mut bytes = Cursor::new(Vec::new());
        file.write().non_parallel().to_buffered(&mut bytes).unwrap();
        let picture = exr_read::decode(Path::new("x.exr"), &bytes.into_inner()).unwrap();
        picture.pixels.iter().map(|p| p.y).collect::<Vec<f32>>()
    };
    let expected: Vec<f32> = (0..15).map(|i| i as f32).collect();
    let kinds = [
        FlatSamples::U32((0..15).collect()),
        FlatSamples::F16((0..15u8).map(f16::from).collect()),
        FlatSamples::F32(expected.clone()),
    ];
    let tiles = Blocks::Tiles(Vec2(4, 2));
    for samples in kinds {
        for compression in [Compression::PIZ, Compression::RLE, Compression::ZIP1, Compression::Uncompressed] {
            for blocks in [tiles, Blocks::ScanLines] {
                let picture = part("main", "", compression, blocks, samples.clone());
                // The picture lies in the second part; a layer with a dotted name before it must not win.
                let other = part("aux", "albedo.", compression, blocks, FlatSamples::F32(vec![9.0; 15]));
                assert_eq!(decoded(vec![other, picture]), expected, "{compression} {blocks:?}");
            }
        }
    }
}
