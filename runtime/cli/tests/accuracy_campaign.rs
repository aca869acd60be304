//! A campaign of demanded accuracies on random smooth scenes with exact solutions: how often a true error is above a demand
//! that counts as reached. Counts are printed:
//!
//! ```text
//! WFL_CAMPAIGN=400 cargo test --release -p wfl-cli --test command accuracy_campaign:: -- --nocapture
//! ```
//!
//! Solutions are one or two Gaussians of anisotropic width (0.05 to 0.5) on the unit square beside a smooth part, on 2 to 4
//! cells a side, quadrilaterals or triangles, with a constant or variable coefficient. Quantities: flux through a side, value
//! at a point, mean on a side, integral over a half, energy, largest value, L2, H1. Right values are integrals with 128^2
//! Gauss points. Scenes are pure functions of their numbers.

use std::{fs, path::Path, process::Command};

use serde_json::Value;

/// Scenes where nothing is said: a few in development, more in the release suite.
const FEW: usize = 6;
const MANY: usize = 60;
/// Of a hundred demands so many may be exceeded by less than `BY`, and none by more. A search sees finitely many points, so
/// that there are always scenes that it misses; 14 of 400 were exceeded, three of them by more than 3, when the parts of
/// an error were not estimated one by one.
const EXCEEDED: f64 = 0.02;
const BY: f64 = 3.0;

/// A linear congruential generator with 64 bits (Knuth, The Art of Computer Programming 2, 3.3.4), upper bits alone.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }

    /// Rounded to what a scene says of it.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        ((low + (high - low) * self.unit()) * 1e4).round() / 1e4
    }

    fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[((self.unit() * list.len() as f64) as usize).min(list.len() - 1)]
    }
}

/// `a exp(-((x - x0)/wx)^2 - ((y - y0)/wy)^2)`
type Gaussian = [f64; 5];

struct Scene {
    cells: usize,
    shape: &'static str,
    variable: bool,
    peaks: Vec<Gaussian>,
    slope: f64,
    level: f64,
    point: [f64; 2],
}

impl Scene {
    fn new(r: &mut Random) -> Self {
        let width = |r: &mut Random| (0.05 * 10f64.powf(r.unit()) * 1e4).round() / 1e4;
        let peak =
            |r: &mut Random| [r.between(-1.0, 1.0), r.between(0.1, 0.9), r.between(0.1, 0.9), width(r), width(r)];
        let n = r.of(&[1, 2]);
        Scene {
            cells: r.of(&[2, 3, 4]),
            shape: r.of(&["quad", "tri"]),
            variable: r.of(&[false, true]),
            peaks: (0..n).map(|_| peak(r)).collect(),
            slope: r.between(-0.5, 0.5),
            level: r.between(0.3, 0.7),
            point: [r.between(0.1, 0.9), r.between(0.1, 0.9)],
        }
    }

    fn text(&self) -> String {
        let one = |[a, x, y, wx, wy]: &Gaussian| format!("({a})*exp(-sqr((x-{x})/{wx}) - sqr((y-{y})/{wy}))");
        let peaks: Vec<String> = self.peaks.iter().map(one).collect();
        let (n, shape, k) = (self.cells, self.shape, if self.variable { "1 + x" } else { "1" });
        let [px, py] = self.point;
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [{n},{n}] {shape}\nregion east = faces where x == 1\n\
             region north = faces where y == 1\nregion rest = boundary - east\nunknown u : scalar\ndef k = {k}\n\
             def exact = {} + ({})*x*y + {}\nterm d on all : k*Grad_u.Grad_Test_u\n\
             load u = -Div(k*Grad(exact)) on all\nload u = k*Grad(exact).Normal on east\nfix u = exact on rest\n\
             measure flux = integral(k*Grad_u.Normal) on north\nmeasure pv = value(u) at [{px},{py}]\n\
             measure mean_east = mean(u) on east\nmeasure part = integral(if x > 0.5 then u else 0) on all\n\
             measure en = integral(k*Norm_sqr(Grad_u)) on all\nmeasure umax = max(u) at nodes of all\n",
            peaks.join(" + "),
            self.slope,
            self.level
        )
    }

    /// Value and gradient.
    fn at(&self, x: f64, y: f64) -> [f64; 3] {
        let mut out = [self.slope * x * y + self.level, self.slope * y, self.slope * x];
        for [a, x0, y0, wx, wy] in &self.peaks {
            let e = a * (-((x - x0) / wx).powi(2) - ((y - y0) / wy).powi(2)).exp();
            out[0] += e;
            out[1] -= 2.0 * (x - x0) / (wx * wx) * e;
            out[2] -= 2.0 * (y - y0) / (wy * wy) * e;
        }
        out
    }

    fn coefficient(&self, x: f64) -> f64 {
        if self.variable { 1.0 + x } else { 1.0 }
    }

    fn right(&self, quantity: &str) -> f64 {
        let line = |f: &dyn Fn(f64) -> f64| gauss().iter().map(|(x, w)| w * f(*x)).sum::<f64>();
        let square = |f: &dyn Fn(f64, f64) -> f64| line(&|x| line(&|y| f(x, y)));
        match quantity {
            "flux" => line(&|x| self.coefficient(x) * self.at(x, 1.0)[2]),
            "pv" => self.at(self.point[0], self.point[1])[0],
            "mean_east" => line(&|y| self.at(1.0, y)[0]),
            "part" => square(&|x, y| if x > 0.5 { self.at(x, y)[0] } else { 0.0 }),
            "en" => square(&|x, y| {
                let [_, gx, gy] = self.at(x, y);
                self.coefficient(x) * (gx * gx + gy * gy)
            }),
            _ => self.largest(),
        }
    }

    /// The largest value: on a lattice, then with halved steps.
    fn largest(&self) -> f64 {
        let lattice = (0..=100).flat_map(|i| (0..=100).map(move |j| [f64::from(i) / 100.0, f64::from(j) / 100.0]));
        let value = |p: &[f64; 2]| self.at(p[0], p[1])[0];
        let mut best = lattice.max_by(|a, b| value(a).total_cmp(&value(b))).unwrap_or([0.0; 2]);
        let mut step = 0.005;
        while step > 1e-9 {
            let near = (0..9).map(|k| {
                let shift = [f64::from(k % 3 - 1) * step, f64::from(k / 3 - 1) * step];
                [0, 1].map(|d| (best[d] + shift[d]).clamp(0.0, 1.0))
            });
            let next = near.max_by(|a, b| value(a).total_cmp(&value(b))).unwrap_or(best);
            if value(&next) > value(&best) { best = next } else { step *= 0.5 }
        }
        value(&best)
    }
}

/// Points and weights of 16 Gauss rules of 8 points on the unit interval.
fn gauss() -> Vec<(f64, f64)> {
    let rule = wfl_mesh::quadrature::gauss(wfl_mesh::mesh::CellKind::Segment, 8).expect("a rule");
    let parts = 16;
    let of = |k: usize| {
        let place = move |x: f64| (k as f64 + x) / parts as f64;
        rule.points.iter().zip(&rule.weights).map(move |(x, w)| (place(x[0]), w / parts as f64)).collect::<Vec<_>>()
    };
    (0..parts).flat_map(of).collect()
}

/// The exit code, the estimate and the true error of one demand.
fn one(scene: &Scene, demanded: f64, quantity: &str, folder: &Path) -> (i32, f64, f64) {
    let (file, out) = (folder.join("scene.wfl"), folder.join("out"));
    fs::write(&file, scene.text()).expect("a file");
    let words = ["--threads", "1", "-q", "--budget", "60", "--of", quantity, "--accuracy", &demanded.to_string()];
    let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
    let ended = command.arg("run").arg(&file).args(words).arg("--out").arg(&out).output().expect("wfl runs");
    let report = fs::read_to_string(out.join("report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("a report is JSON");
    let record = &report["accuracy"];
    let truth = match quantity {
        "L2" | "H1" => record["truth"].as_f64().unwrap_or(f64::NAN),
        measure => {
            let found = report["steps"][0]["measures"][measure].as_f64().unwrap_or(f64::NAN);
            (found / scene.right(measure) - 1.0).abs()
        }
    };
    (ended.status.code().unwrap_or(-1), record["estimate"].as_f64().unwrap_or(f64::NAN), truth)
}

#[test]
#[expect(clippy::print_stdout, reason = "a campaign prints its counts")]
fn a_demand_that_counts_as_reached_is_met_on_random_smooth_scenes() {
    let folder = crate::common::Folder::new("accuracy-campaign");
    let n = std::env::var("WFL_CAMPAIGN").ok().and_then(|n| n.parse().ok());
    let n: usize = n.unwrap_or(if cfg!(debug_assertions) { FEW } else { MANY });
    let mut random = Random(20_261_125);
    let cases: Vec<(usize, Scene, &str, f64)> = (0..n)
        .map(|k| {
            let scene = Scene::new(&mut random);
            let quantity = random.of(&["flux", "pv", "mean_east", "part", "en", "umax", "L2", "H1"]);
            (k, scene, quantity, random.of(&[0.1, 0.03, 0.01, 3e-3, 1e-3]))
        })
        .collect();
    let ended = crate::common::side_by_side(&cases, |(k, scene, quantity, demanded)| {
        let own = folder.0.join(k.to_string());
        fs::create_dir_all(&own).expect("a folder");
        one(scene, *demanded, quantity, &own)
    });
    let (mut reached, mut refused, mut above) = (0, 0, Vec::new());
    for ((k, scene, quantity, demanded), (code, estimate, truth)) in cases.iter().zip(ended) {
        assert!(code == 0 || code == 4, "scene {k}: exit {code}\n{}", scene.text());
        if code == 4 {
            refused += 1;
            continue;
        }
        reached += 1;
        assert!(truth.is_finite(), "scene {k}, {quantity}\n{}", scene.text());
        if truth > *demanded {
            println!("scene {k}: {quantity} {demanded}: true error {truth:.2e}, estimate {estimate:.2e}");
            above.push((truth / demanded, k, scene.text()));
        }
    }
    let far = above.iter().filter(|a| a.0 > BY).count();
    println!(
        "{n} demands: {reached} reached, {refused} not (exit 4); {} true errors above a reached demand, {far} by more than {BY}",
        above.len()
    );
    let most = (EXCEEDED * n as f64).ceil() as usize;
    assert!(far == 0 && above.len() <= most, "{above:?}");
}
