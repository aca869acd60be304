use super::*;

/// Numbers of an attribute of all elements that have this class.
fn numbers(svg: &str, class: &str, attribute: &str) -> Vec<f64> {
    let key = format!("{attribute}=\"");
    let of = |line: &&str| line.contains(&format!("class=\"{class}"));
    svg.lines()
        .filter(of)
        .filter_map(|line| line.split_once(&key))
        .flat_map(|(_, rest)| rest.split_once('"').map_or("", |(a, _)| a).split([' ', ',']))
        .map(|n| n.parse().unwrap())
        .collect()
}

#[test]
fn equal_ratios_are_equally_far_on_a_logarithmic_axis() {
    let series = Series::new("r", [[0.0, 1.0], [1.0, 1e-3], [2.0, 1e-6]]);
    let svg = Chart::new("Newton").x("iteration", Scale::Linear).y("residual [-]", Scale::Log).line(series).svg();
    let xy = numbers(&svg, "l c0", "points");
    assert_eq!(xy.len(), 6);
    assert!((xy[2] - xy[0] - (xy[4] - xy[2])).abs() < 0.11 && xy[0] < xy[2]);
    assert!((xy[3] - xy[1] - (xy[5] - xy[3])).abs() < 0.11 && xy[1] < xy[3], "small numbers are below: {xy:?}");
}

#[test]
fn what_has_no_place_is_counted_and_leaves_a_gap() {
    let series = Series::new("r", [[0.0, 1.0], [1.0, 2.0], [2.0, f64::NAN], [3.0, 0.0], [4.0, 3.0], [5.0, 4.0]]);
    let svg = Chart::new("t").y("y", Scale::Log).line(series.clone()).svg();
    assert!(svg.contains("2 values are not shown: not finite, or not positive"), "{svg}");
    assert_eq!(svg.matches("<polyline").count(), 2);
    let svg = Chart::new("t").line(series).svg();
    assert!(svg.contains("1 value is not shown: not finite<"), "{svg}");
}

#[test]
fn bars_start_at_zero_and_are_as_long_as_their_numbers() {
    let bars = [Bar::new("a", 2.0), Bar::new("b", 1.0), Bar::new("c", f64::NAN)];
    let svg = Chart::new("Time").x("time [s]", Scale::Linear).bars(bars).svg();
    let lengths = numbers(&svg, "c0 z", "width");
    assert!((lengths[0] / lengths[1] - 2.0).abs() < 0.01, "{lengths:?}");
    assert!(svg.contains("not a number") && svg.contains("1 value is not shown"));
}

#[test]
fn a_map_colours_its_range_from_end_to_end() {
    let cells = (0..3).map(|k| {
        let x = f64::from(k);
        MapCell::rectangle([x, 0.0], [x + 1.0, 1.0], x)
    });
    let svg = Chart::new("slip").map("slip [m]", cells).svg();
    for colour in [0.0, 0.5, 1.0].map(crate::viridis) {
        assert!(svg.contains(&format!("<polygon class=\"z\" fill=\"{colour}\"")), "{colour}");
    }
}

#[test]
fn states_have_their_colours_and_names() {
    let cells = [MapCell::rectangle([0.0; 2], [1.0; 2], 1.0), MapCell::rectangle([1.0; 2], [2.0; 2], 0.0)];
    let states = [("open", None), ("slip", Some(Colour::Palette(1)))];
    let svg = Chart::new("state").states(states, cells).equal().svg();
    assert!(svg.contains("<polygon class=\"c1 z\"") && svg.contains("<polygon class=\"o z\""), "{svg}");
    assert!(svg.contains(">open</text>") && svg.contains(">slip</text>"));
}

#[test]
fn names_and_notes_are_escaped() {
    let svg = Chart::new("a<b").x("\"x\"", Scale::Linear).line(Series::new("s&t", [[0.0, 1.0], [1.0, 2.0]])).svg();
    assert!(svg.contains("a&lt;b") && svg.contains("s&amp;t") && !svg.contains("a<b"));
}

#[test]
fn empty_charts_say_so() {
    assert!(Chart::new("t").svg().contains("no data"));
    assert!(Chart::new("t").line(Series::new("", [])).svg().contains("no data"));
}

#[test]
fn bands_stand_behind_the_data_and_short_ones_can_be_seen() {
    let chart = Chart::new("V").x("t", Scale::Linear).y("V", Scale::Linear);
    let chart = chart.band(2.0, 4.0, "long").band(6.0, 6.0, "short").band(20.0, 30.0, "outside");
    let svg = chart.line(Series::new("V", [[0.0, 1.0], [10.0, 2.0]])).svg();
    let width = |note: &str| -> f64 {
        let (before, _) = svg.split_once(note).unwrap_or_else(|| panic!("no {note}"));
        let rect = before.rsplit_once("<rect").expect("a rectangle").1;
        rect.split_once("width=\"").and_then(|(_, w)| w.split_once('"')).expect("a width").0.parse().expect("a number")
    };
    assert!(width("long") > 20.0 && (width("short") - 2.0).abs() < 1e-9 && !svg.contains("outside"), "{svg}");
    assert!(svg.find("long") < svg.find("class=\"l "), "the line is drawn on the band");
}
