//! Charts one after the other, as a film in one file (GIF).
//!
//! Promises: the same charts give the same bytes; frames are as large as the largest chart, on light ground.

use gif::{Encoder, Frame, Repeat};

use crate::{
    chart::Chart,
    raster::{Pixels, PngError, pixels, pixels_of},
};

/// How well colours are told apart when they are reduced to the 256 of a frame: 1 is best, 30 is fastest. 10 is what the
/// encoder recommends; charts have few hundred colours.
const SPEED: i32 = 10;
const WHITE: u8 = 0xff;

/// A film that is shown again and again; each chart stays for so many hundredths of a second.
///
/// # Errors
/// [`PngError`] when there is no chart, or one that would have no pixels or more than memory has room for.
pub fn film(charts: &[Chart], hundredths: u16) -> Result<Vec<u8>, PngError> {
    let mut size = [0, 0];
    for chart in charts {
        let own = pixels_of(chart.marks().1)?;
        size = [size[0].max(own[0]), size[1].max(own[1])];
    }
    let [w, h] = size;
    let (Ok(width), Ok(height)) = (u16::try_from(w), u16::try_from(h)) else { return Err(PngError::Size([w, h])) };
    if width == 0 || height == 0 {
        return Err(PngError::Size([w, h]));
    }
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, width, height, &[]).map_err(PngError::Film)?;
    encoder.set_repeat(Repeat::Infinite).map_err(PngError::Film)?;
    // one picture at a time: all of them together may be more than memory has room for
    for chart in charts {
        let (marks, own) = chart.marks();
        let whole = padded(&pixels(&marks, own)?, size)?;
        let mut frame = Frame::from_rgb_speed(width, height, &whole, SPEED);
        frame.delay = hundredths;
        encoder.write_frame(&frame).map_err(PngError::Film)?;
    }
    drop(encoder);
    Ok(file)
}

/// Pixels in the upper left corner of a white ground.
fn padded(frame: &Pixels, [width, height]: [usize; 2]) -> Result<Vec<u8>, PngError> {
    let [w, h] = frame.size;
    let bytes = width.checked_mul(height).and_then(|n| n.checked_mul(3)).ok_or(PngError::Size([width, height]))?;
    let mut whole = vec![WHITE; bytes];
    for row in 0..h {
        whole[3 * row * width..][..3 * w].copy_from_slice(&frame.rgb[3 * row * w..][..3 * w]);
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scale, Series};

    #[test]
    fn a_film_has_its_charts_as_frames_of_one_size() {
        let chart = |n: u32| {
            let points = (0..=n).map(|k| [f64::from(k), f64::from(k * n)]);
            Chart::new("a").size(200.0 + 20.0 * f64::from(n), 150.0).x("x", Scale::Linear).line(Series::new("", points))
        };
        let charts: Vec<Chart> = (1..4).map(chart).collect();
        let file = film(&charts, 20).unwrap();
        assert_eq!(file, film(&charts, 20).unwrap());
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(file.as_slice()).unwrap();
        let mut frames = 0;
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            assert_eq!((frame.delay, [frame.width, frame.height]), (20, [520, 300]));
            frames += 1;
        }
        assert_eq!(frames, 3);
        assert!(film(&[], 20).is_err());
    }
}
