//! From where solid bodies are seen, parallel: no point is nearer than another in size.

/// The place of the reader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Angle about z from x towards y, in degrees: at -90 the reader looks along y, with x to the right.
    pub azimuth: f64,
    /// Angle above the plane of x and y, in degrees.
    pub elevation: f64,
}

impl Default for View {
    fn default() -> Self {
        View { azimuth: -60.0, elevation: 25.0 }
    }
}

impl View {
    /// A place in the view: to the right, up, towards the reader. Lengths stay as they are.
    pub(crate) fn at(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sa, ca) = self.azimuth.to_radians().sin_cos();
        let (se, ce) = self.elevation.to_radians().sin_cos();
        [-sa * x + ca * y, -se * ca * x - se * sa * y + ce * z, ce * ca * x + ce * sa * y + se * z]
    }

    /// The axes x, y, z: to the right and up.
    pub(crate) fn axes(&self) -> [[f64; 2]; 3] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| {
            let [right, up, _] = self.at(axis);
            [right, up]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_the_front_x_points_right_and_z_up_and_near_points_have_a_smaller_y() {
        let front = View { azimuth: -90.0, elevation: 0.0 };
        let [right, up, near] = front.at([1.0, 2.0, 3.0]);
        assert!((right - 1.0).abs() < 1e-12 && (up - 3.0).abs() < 1e-12 && (near + 2.0).abs() < 1e-12);
        let above = View { azimuth: -90.0, elevation: 90.0 };
        let [right, up, near] = above.at([1.0, 2.0, 3.0]);
        assert!((right - 1.0).abs() < 1e-12 && (up - 2.0).abs() < 1e-12 && (near - 3.0).abs() < 1e-12);
        let p = View::default().at([1.0, 2.0, 3.0]);
        assert!((p.iter().map(|x| x * x).sum::<f64>() - 14.0).abs() < 1e-12);
    }
}
