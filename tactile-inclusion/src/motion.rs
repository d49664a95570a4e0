//! How a block's mesh moves with its parameters.

use super::parameters::{LumpParameters, Parameters};

/// How points of the block move: the inclusion as a rigid circle that grows, the far side with the
/// height, linearly in between, the face not at all.
pub(crate) struct Motion {
    radius: f64,
    /// Depth of the inclusion's centre.
    centre: f64,
    grown: f64,
    sunk: f64,
    height: f64,
    raised: f64,
    face_radius: f64,
}

impl Motion {
    pub(crate) fn new(from: &Parameters, to: &Parameters, face_radius: f64) -> Self {
        let circle = |parameters: &Parameters| {
            let lump = parameters.lump.map(sizes);
            lump.map_or([0.0; 2], |[diameter, depth]| {
                [0.5 * diameter, depth + 0.5 * diameter]
            })
        };
        let ([radius, centre], [radius_after, centre_after]) = (circle(from), circle(to));
        Self {
            radius,
            centre,
            grown: radius_after - radius,
            sunk: centre_after - centre,
            height: from.height_m,
            raised: to.height_m - from.height_m,
            face_radius,
        }
    }

    pub(crate) fn moved(&self, [r, z]: [f64; 2]) -> [f64; 2] {
        if z <= 0.0 {
            return [r, z];
        }
        let bottom = self.centre + self.radius;
        let lifted = self.raised * ((z - bottom) / (self.height - bottom)).max(0.0);
        let [along_r, along_z] = self.by_inclusion([r, z]);
        [r + along_r, z + along_z + lifted]
    }

    fn by_inclusion(&self, [r, z]: [f64; 2]) -> [f64; 2] {
        let offset = z - self.centre;
        let distance = r.hypot(offset);
        if self.radius == 0.0 || distance == 0.0 {
            return [0.0, self.sunk];
        }
        let [across, along] = [r / distance, offset / distance];
        if distance <= self.radius {
            let growth = self.grown * distance / self.radius;
            return [growth * across, growth * along + self.sunk];
        }
        // The ray from the centre through the point ends at the face, the far side or below the rim.
        let to_face = if along < 0.0 {
            self.centre / -along
        } else {
            f64::INFINITY
        };
        let to_far = if along > 0.0 {
            (self.height - self.centre) / along
        } else {
            f64::INFINITY
        };
        let to_rim = if across > 0.0 {
            self.face_radius / across
        } else {
            f64::INFINITY
        };
        let end = to_face.min(to_far).min(to_rim);
        let part = ((end - distance) / (end - self.radius)).max(0.0);
        [
            part * self.grown * across,
            part * (self.grown * along + self.sunk),
        ]
    }
}

/// What the mesh depends on: diameter and depth.
pub(crate) fn sizes(lump: LumpParameters) -> [f64; 2] {
    [lump.diameter_m, lump.depth_m]
}
