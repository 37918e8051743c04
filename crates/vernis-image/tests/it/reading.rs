//! Files of pictures: each format comes back as it was written, and what is wrong with a file is said.

use image::codecs::hdr::HdrEncoder;
use image::{ImageBuffer, ImageOutputFormat, Luma, LumaA, Rgb, Rgba};
use std::fs;
use std::io::Cursor;
use vernis_image::picture::read::{decode, read};
use vernis_image::picture::{EncodedPicture, Encoding};

fn bytes<P>(picture: &ImageBuffer<P, Vec<P::Subpixel>>, format: ImageOutputFormat) -> Vec<u8>
where
    P: image::PixelWithColorType,
    [P::Subpixel]: image::EncodableLayout,
{
    let mut out = Cursor::new(Vec::new());
    picture.write_to(&mut out, format).expect("written");
    out.into_inner()
}

fn refused(bytes: &[u8]) -> String {
    decode(bytes).expect_err("refused").to_string()
}

#[test]
fn codes_come_back_whole() {
    let code = |x: u32, y: u32, c: u32| ((x * 40 + y * 7 + c * 90) % 256) as u8;
    let picture = ImageBuffer::from_fn(5, 3, |x, y| Rgb([code(x, y, 0), code(x, y, 1), code(x, y, 2)]));
    let found = decode(&bytes(&picture, ImageOutputFormat::Png)).expect("a PNG");
    assert_eq!((found.width(), found.height(), found.encoding()), (5, 3, Encoding::Srgb));
    assert_eq!(found.pixels()[7], [code(2, 1, 0), code(2, 1, 1), code(2, 1, 2)].map(f32::from));
    let wide = ImageBuffer::from_fn(2, 1, |x, _| Rgb([257 * x as u16 * 200, 1, 65535]));
    let found = decode(&bytes(&wide, ImageOutputFormat::Png)).expect("a PNG of 16 bits");
    assert_eq!(found.pixels()[1], [200.0, 1.0 / 257.0, 255.0]);
    let grey = ImageBuffer::from_fn(2, 1, |x, _| Luma([x as u8 * 9]));
    assert_eq!(decode(&bytes(&grey, ImageOutputFormat::Png)).expect("grey").pixels()[1], [9.0; 3]);
    let grey = ImageBuffer::from_fn(2, 1, |x, _| Luma([x as u16 * 257]));
    assert_eq!(decode(&bytes(&grey, ImageOutputFormat::Png)).expect("grey of 16 bits").pixels()[1], [1.0; 3]);
    // Even areas survive JPEG but for rounding.
    let even = ImageBuffer::from_pixel(16, 16, Rgb([200u8, 100, 50]));
    let found = decode(&bytes(&even, ImageOutputFormat::Jpeg(95))).expect("a JPEG");
    assert!(found.pixels()[40].iter().zip([200.0, 100.0, 50.0]).all(|(a, b)| (a - b).abs() <= 2.0));
}

#[test]
fn alpha_must_be_opaque() {
    let opaque = ImageBuffer::from_pixel(3, 2, Rgba([1u8, 2, 3, 255]));
    assert_eq!(decode(&bytes(&opaque, ImageOutputFormat::Png)).expect("opaque").pixels()[0], [1.0, 2.0, 3.0]);
    let mut clear = opaque;
    clear.put_pixel(2, 1, Rgba([1, 2, 3, 51]));
    let message = refused(&bytes(&clear, ImageOutputFormat::Png));
    assert!(message.starts_with("pixel (2, 1) has alpha 0.2"), "{message}");
    assert!(message.ends_with("alpha must be 1 everywhere, so flatten the picture first"), "{message}");
    let grey = ImageBuffer::from_pixel(1, 1, LumaA([7u16, 65534]));
    assert!(refused(&bytes(&grey, ImageOutputFormat::Png)).starts_with("pixel (0, 0) has alpha 0.9999"));
}

fn exr(channels: &[(&str, Vec<f32>)], size: (usize, usize), chromaticities: Option<[f32; 8]>) -> Vec<u8> {
    use exr::prelude::*;
    let list = channels.iter().map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.clone())));
    let channels = AnyChannels::sort(list.collect());
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::FAST_LOSSLESS, channels);
    let mut image = Image::from_layer(layer);
    image.attributes.chromaticities = chromaticities.map(|c| attribute::Chromaticities {
        red: Vec2(c[0], c[1]),
        green: Vec2(c[2], c[3]),
        blue: Vec2(c[4], c[5]),
        white: Vec2(c[6], c[7]),
    });
    let mut out = Cursor::new(Vec::new());
    image.write().to_buffered(&mut out).expect("written");
    out.into_inner()
}

#[test]
fn exr_gives_light() {
    let (r, g, b) = (vec![0.5, 1e4, 3.0], vec![1.0; 3], vec![0.0, 1e-6, 2.0]);
    let rgb = [("R", r), ("G", g), ("B", b)];
    let found = decode(&exr(&rgb, (3, 1), None)).expect("an EXR");
    assert_eq!((found.encoding(), found.pixels()[1]), (Encoding::Linear, [1e4, 1.0, 1e-6]));
    let grey = decode(&exr(&[("Y", vec![1.0, 2.0])], (1, 2), None)).expect("grey");
    assert_eq!((grey.height(), grey.pixels()[1]), (2, [2.0; 3]));
    let bt709 = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
    assert!(decode(&exr(&rgb, (3, 1), Some(bt709))).is_ok());
    let bt2020 = [0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290];
    let message = refused(&exr(&rgb, (3, 1), Some(bt2020)));
    assert!(message.contains("they must be those of BT.709"), "{message}");
    let mut with_alpha = rgb.to_vec();
    with_alpha.push(("A", vec![1.0, 0.0, 1.0]));
    assert!(refused(&exr(&with_alpha, (3, 1), None)).starts_with("pixel (1, 0) has alpha 0;"));
    let depth = refused(&exr(&[("Z", vec![1.0, 2.0])], (2, 1), None));
    assert!(depth.ends_with("its channels are Z; it must have R, G and B, or Y"), "{depth}");
    for (value, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (-1.0, "-1")] {
        let mut wrong = rgb.to_vec();
        wrong[1].1[2] = value;
        let message = refused(&exr(&wrong, (3, 1), None));
        assert_eq!(message, format!("pixel (2, 0) has green {shown}; it must be from 0 to 1e10 cd/m2"));
    }
    let whole = exr(&rgb, (3, 1), None);
    for end in [4, whole.len() / 2, whole.len() - 1] {
        assert!(refused(&whole[..end]).starts_with("it cannot be read as OpenEXR: "), "{end}");
    }
}

#[test]
fn radiance_gives_light() {
    let mut out = Vec::new();
    let pixels: Vec<_> = (0..16).map(|i| Rgb([i as f32, 0.5, 100.0])).collect();
    HdrEncoder::new(&mut out).encode(&pixels, 8, 2).expect("written");
    let found = decode(&out).expect("an HDR");
    assert_eq!((found.width(), found.height(), found.encoding()), (8, 2, Encoding::Linear));
    assert!(found.pixels().iter().zip(&pixels).all(|(a, b)| (a[0] - b.0[0]).abs() < 0.5 && a[2] == 100.0));
    // Twice the exposure: the light is half of what is written.
    let text = out.windows(7).position(|w| w == b"FORMAT=").expect("a header");
    let mut exposed = out[..text].to_vec();
    exposed.extend(b"EXPOSURE=2.0\n");
    exposed.extend(&out[text..]);
    assert_eq!(decode(&exposed).expect("an HDR").pixels()[0][2], 50.0);
    let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 4000\n\x02\x02\x00\x00".to_vec();
    assert!(refused(&huge).contains("bytes cannot hold its 4000 x 4000 pixels"));
    assert!(refused(&out[..out.len() - 4]).starts_with("it cannot be read as Radiance HDR: "));
}

#[test]
fn pfm_gives_light_from_the_bottom_up() {
    let values: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let little: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let big: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    let file = |header: &str, body: &[u8]| [header.as_bytes(), body].concat();
    for bytes in [file("PF\n2 2\n-1.0\n", &little), file("PF 2 2 1 ", &big)] {
        let found = decode(&bytes).expect("a PFM");
        assert_eq!((found.width(), found.height()), (2, 2));
        // The last row of the file is the top of the picture.
        assert_eq!(found.pixels(), [[6.0, 7.0, 8.0], [9.0, 10.0, 11.0], [0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
    }
    let grey = decode(&file("Pf\n3 4\n-1\n", &little)).expect("grey");
    assert_eq!(grey.pixels()[0], [9.0; 3]);
    for (bytes, expected) in [
        (file("PF\n2 2\n-1.0\n", &little[1..]), "its pixels take 47 bytes; 2 x 2 must take 48"),
        (file("PF\n2 x\n-1.0\n", &little), "its height is \"x\"; it must be a whole number"),
        (file("PF\n2 2\n-3\n", &little), "its scale is \"-3\"; it must be -1 (little-endian) or 1 (big-endian)"),
        (file("PF\n", &[]), "its width is \"\"; it must be a whole number"),
    ] {
        assert_eq!(refused(&bytes), format!("it cannot be read as PFM: {expected}"));
    }
    assert!(refused(&file("PF\n999999 999999\n-1\n", &[])).starts_with("it has 999999 x 999999 pixels;"));
}

#[test]
fn what_is_no_picture_is_said() {
    assert!(refused(b"").starts_with("it begins with nothing; it must be a PNG"));
    assert_eq!(
        refused(b"hello\x1b[31m"),
        "it begins with \"hello\\u001b[3\"; it must be a PNG, JPEG, OpenEXR, Radiance HDR or PFM picture"
    );
    let png = bytes(&ImageBuffer::from_pixel(40, 40, Rgb([1u8, 2, 3])), ImageOutputFormat::Png);
    let noise =
        ImageBuffer::from_fn(64, 64, |x, y| Rgb([(x * y * 37 % 251) as u8, (x * 91 % 256) as u8, (y * 13) as u8]));
    let jpeg = bytes(&noise, ImageOutputFormat::Jpeg(90));
    for (name, whole) in [("PNG", png), ("JPEG", jpeg)] {
        for end in [8, whole.len() / 2] {
            assert!(refused(&whole[..end]).starts_with(&format!("it cannot be read as {name}: ")), "{name} {end}");
        }
    }
}

/// A header of a PNG of a hundred thousand pixels a side, and nothing else: refused before anything is decoded.
#[test]
fn huge_pictures_are_refused_by_their_header() {
    let small = bytes(&ImageBuffer::from_pixel(1, 1, Rgb([0u8; 3])), ImageOutputFormat::Png);
    let mut huge = small.clone();
    huge[16..20].copy_from_slice(&100_000u32.to_be_bytes());
    huge[20..24].copy_from_slice(&100_000u32.to_be_bytes());
    let sum = crc32(&huge[12..29]);
    huge[29..33].copy_from_slice(&sum.to_be_bytes());
    let message = refused(&huge);
    assert!(message.contains("100000 x 100000") || message.contains("exceed"), "{message}");
}

/// The check sum of PNG, annex D of its specification.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 })
    })
}

/// Whatever byte of a file is wrong, there is a picture or a message.
#[test]
fn damaged_files_never_panic() {
    let picture = ImageBuffer::from_fn(9, 7, |x, y| Rgb([(x * 31) as u8, (y * 29) as u8, (x * y) as u8]));
    let mut hdr = Vec::new();
    let pixels: Vec<_> = (0..63).map(|i| Rgb([i as f32, 0.5, 100.0])).collect();
    HdrEncoder::new(&mut hdr).encode(&pixels, 9, 7).expect("written");
    let values = vec![0.5; 63];
    let files = [
        bytes(&picture, ImageOutputFormat::Png),
        bytes(&picture, ImageOutputFormat::Jpeg(80)),
        exr(&[("R", values.clone()), ("G", values.clone()), ("B", values)], (9, 7), None),
        hdr,
        [b"PF 9 7 -1\n".to_vec(), vec![0; 9 * 7 * 12]].concat(),
    ];
    for file in files {
        assert!(decode(&file).is_ok());
        let mut refused = 0;
        for at in 0..file.len().min(600) {
            for value in [0x00, 0xff, file[at] ^ 0x10] {
                let mut damaged = file.clone();
                damaged[at] = value;
                refused += usize::from(decode(&damaged).is_err());
            }
        }
        assert!(refused > 0);
    }
}

#[test]
fn files_are_named_in_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    assert!(read(&path).unwrap_err().to_string().contains("a.png: "));
    fs::write(&path, "text").expect("writable");
    let message = read(&path).unwrap_err().to_string();
    assert!(message.contains("a.png: it begins with \"text\";"), "{message}");
    let folder = read(folder.path()).unwrap_err().to_string();
    assert!(folder.ends_with("it is a folder; it must be a regular file"), "{folder}");
}

#[test]
fn rendered_pictures_are_light() {
    let picture = vernis_image::picture::Picture::new(2, 1, vec![[0.5, 1.0, 2.0], [0.0; 3]]).expect("a picture");
    let found = EncodedPicture::of_light(&picture).expect("light");
    assert_eq!((found.encoding(), found.pixels()), (Encoding::Linear, picture.pixels()));
}
