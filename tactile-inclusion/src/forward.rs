//! The interface pressure of a block with an inclusion under a guide, and its derivatives. The mesh
//! moves with the parameters.

use crate::parameters::{BLOCK, Coordinate, LumpParameters, Parameters};
use crate::picture::{Cells, PlainBlock};
use std::sync::Arc;
use tactile_elasticity::ElasticityError;
use tactile_fem::{
    Block, FemScene, FrameResponse, Guide, Interface, Kinematics, Lump, Material, SolvedFrames,
};

/// Maximum change of the logarithm of a length by which a mesh is moved.
const LARGEST_MESH_CHANGE: f64 = 0.3;

/// Motion of the points of the block. The inclusion moves as an ellipse with growing axes, the far
/// side moves with the height, and the face does not move. Between them the motion is linear.
struct MeshMotion {
    /// Half axes of the inclusion across and along the axis. Zero without an inclusion.
    half_axes: [f64; 2],
    /// Depth of the inclusion's centre.
    centre: f64,
    grown: [f64; 2],
    sunk: f64,
    height: f64,
    raised: f64,
    face_radius: f64,
}

impl MeshMotion {
    pub(crate) fn new(from: &Parameters, to: &Parameters, face_radius: f64) -> Self {
        let ellipse = |parameters: &Parameters| {
            let lump = parameters.lump.map(sizes);
            lump.map_or(([0.0; 2], 0.0), |[width, height, depth]| {
                ([0.5 * width, 0.5 * height], depth + 0.5 * height)
            })
        };
        let ((half_axes, centre), (axes_after, centre_after)) = (ellipse(from), ellipse(to));
        Self {
            half_axes,
            centre,
            grown: [0, 1].map(|k| axes_after[k] - half_axes[k]),
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
        let bottom = self.centre + self.half_axes[1];
        let lifted = self.raised * ((z - bottom) / (self.height - bottom)).max(0.0);
        let [along_r, along_z] = self.by_inclusion([r, z]);
        [r + along_r, z + along_z + lifted]
    }

    fn by_inclusion(&self, [r, z]: [f64; 2]) -> [f64; 2] {
        let offset = z - self.centre;
        let [radius, half_height] = self.half_axes;
        // In units of the half axes, the ellipse is the unit circle.
        let [across, along] = [r / radius, offset / half_height];
        let distance = across.hypot(along);
        if radius == 0.0 || distance == 0.0 {
            return [0.0, self.sunk];
        }
        if distance <= 1.0 {
            let [wider, taller] = self.grown;
            return [wider * across, taller * along + self.sunk];
        }
        let [across, along] = [across / distance, along / distance];
        // The ray from the centre through the point ends at the face, at the far side or below the
        // rim.
        let to_face = if along < 0.0 {
            self.centre / (-along * half_height)
        } else {
            f64::INFINITY
        };
        let to_far = if along > 0.0 {
            (self.height - self.centre) / (along * half_height)
        } else {
            f64::INFINITY
        };
        let to_rim = if across > 0.0 {
            self.face_radius / (across * radius)
        } else {
            f64::INFINITY
        };
        let end = to_face.min(to_far).min(to_rim);
        let part = ((end - distance) / (end - 1.0)).max(0.0);
        [
            part * self.grown[0] * across,
            part * (self.grown[1] * along + self.sunk),
        ]
    }
}

/// The sizes on which the mesh depends: width, height and depth.
fn sizes(lump: LumpParameters) -> [f64; 3] {
    let [width, height] = lump.axes_m();
    [width, height, lump.depth_m]
}

/// A block of given size under a guide, and the positions at which its pressure is evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Forward {
    pub guide: Guide,
    pub block_radius_m: f64,
    pub interface: Interface,
    /// Approaches as measured, in metres, ascending.
    pub approaches_m: Vec<f64>,
    /// Radii at which the pressure of each frame is evaluated, in metres.
    pub radii_m: Vec<f64>,
    /// Data of a whole face, if the radii are those of its cells.
    pub cells: Option<Cells>,
    /// Elements along an eighth of the inclusion's circumference.
    pub fineness: usize,
    /// Kinematics. Small strain is solved in one iteration, which is accurate enough to rank
    /// starts.
    pub kinematics: Kinematics,
}

/// A solved scene, from which nearby scenes are solved in fewer iterations.
#[derive(Debug, Clone)]
pub(crate) struct Solved {
    meshed: Arc<Meshed>,
    pub frames: SolvedFrames,
    /// The scene with the second inclusion in place of the first. `None` for a single inclusion.
    second: Option<Box<Solved>>,
}

impl Solved {
    /// Pressure of a frame at a distance from the axis.
    pub(crate) fn pressure_at(&self, frame: usize, radius_m: f64) -> f64 {
        self.frames.states()[frame].pressure_at(radius_m)
    }
}

/// A scene as it was meshed, before its mesh is moved to other parameters or along the interface.
///
/// The number of elements, and with it the mesh error, depends on the parameters in jumps. A fit
/// therefore compares solutions on one moved mesh.
#[derive(Debug, Clone)]
struct Meshed {
    scene: FemScene,
    parameters: Parameters,
}

impl Meshed {
    /// Whether the elements are still well shaped if the mesh is moved to these parameters.
    fn reaches(&self, parameters: &Parameters) -> bool {
        let lumps = match (self.parameters.lump, parameters.lump) {
            (None, None) => true,
            (Some(from), Some(to)) => {
                let pairs = sizes(from).into_iter().zip(sizes(to));
                pairs.into_iter().all(|(from, to)| is_near(from, to))
            }
            _ => false,
        };
        lumps && is_near(self.parameters.height_m, parameters.height_m)
    }
}

/// Depth to which a sliding face moves the mesh of the block. The mesh of the inclusion does not
/// move.
fn sliding_depth(parameters: &Parameters) -> f64 {
    (parameters.lump).map_or(0.4 * parameters.height_m, |lump| lump.depth_m)
}

fn is_near(from: f64, to: f64) -> bool {
    (to / from).ln().abs() < LARGEST_MESH_CHANGE
}

impl Forward {
    fn observations(&self) -> usize {
        self.approaches_m.len() * (self.radii_m.len() + 1)
    }

    /// Whether the mesh follows the sliding of the face.
    fn slides(&self) -> bool {
        self.interface == Interface::Frictionless && self.kinematics == Kinematics::Finite
    }

    /// The block under the guide for given parameters.
    ///
    /// # Errors
    /// An error for a lump outside the block, or too small to be meshed.
    pub(crate) fn scene(&self, parameters: &Parameters) -> Result<FemScene, ElasticityError> {
        let material = |modulus| Material::new(modulus, parameters.poisson_ratio);
        let lump = match parameters.lump {
            None => None,
            Some(lump) => Some(Lump {
                diameter_m: lump.axes_m()[0],
                height_m: lump.axes_m()[1],
                depth_m: lump.depth_m,
                material: material(lump.youngs_modulus_pa)?,
            }),
        };
        let block = Block {
            height_m: parameters.height_m,
            radius_m: self.block_radius_m,
            material: material(parameters.block_modulus_pa)?,
            lump,
        };
        FemScene::block_with_mesh(
            &block,
            &self.guide,
            self.interface,
            self.fineness,
            self.kinematics,
        )
    }

    /// Pressures and forces of the frames. `None` if the block cannot be meshed or solved.
    pub(crate) fn predict(&self, parameters: &Parameters) -> Option<Vec<f64>> {
        Some(self.predict_near(parameters, None)?.0)
    }

    /// Like [`Self::predict`], starting from a nearby solved scene. Also returns the new solved
    /// scene.
    pub(crate) fn predict_near(
        &self,
        parameters: &Parameters,
        near: Option<&Solved>,
    ) -> Option<(Vec<f64>, Solved)> {
        let mut solved = self.solve_near(parameters, near)?;
        if parameters.second.is_some() {
            let near = near.and_then(|near| near.second.as_deref());
            solved.second = Some(Box::new(self.solve_near(&parameters.swapped(), near)?));
        }
        let prediction = self.of_solved(parameters, &solved);
        Some((prediction, solved))
    }

    /// Pressures and forces of a block that was solved with its inclusions on the axis, with the
    /// inclusions at the positions in `parameters`.
    pub(crate) fn of_solved(&self, parameters: &Parameters, solved: &Solved) -> Vec<f64> {
        let states = solved.frames.states();
        let of_second = (solved.second.as_ref()).map_or(states, |second| second.frames.states());
        self.collect(
            parameters,
            &|frame, radius| states[frame].pressure_at(radius),
            &|frame, radius| of_second[frame].pressure_at(radius),
            &|frame| states[frame].force_n(),
        )
    }

    /// Solves the block with the first inclusion on the axis, starting from a nearby solved scene.
    fn solve_near(&self, parameters: &Parameters, near: Option<&Solved>) -> Option<Solved> {
        let meshed = match near {
            Some(near) if near.meshed.reaches(parameters) => Arc::clone(&near.meshed),
            _ => {
                let scene = self.scene(parameters).ok()?;
                Arc::new(Meshed {
                    scene,
                    parameters: parameters.clone(),
                })
            }
        };
        let scene = self.changed(&meshed.scene, &meshed.parameters, parameters)?;
        let approaches: Vec<f64> = (self.approaches_m.iter())
            .map(|approach| approach + parameters.zero_m)
            .collect();
        let sliding_depth = self.slides().then(|| sliding_depth(parameters));
        let near = near.map(|near| &near.frames);
        let frames = SolvedFrames::new(&scene, &approaches, sliding_depth, near)?;
        Some(Solved {
            meshed,
            frames,
            second: None,
        })
    }

    /// Adds the plain block, with which the pressure of a block with an inclusion is transferred to
    /// the cells of a face. `None` if the plain block cannot be solved.
    pub(crate) fn with_plain(mut self, parameters: &Parameters) -> Option<Self> {
        let plain = Parameters {
            lump: None,
            second: None,
            ..parameters.clone()
        };
        if self.cells.is_some() {
            let (_, solved) = self.predict_near(&plain, None)?;
            let mut responses = self.responses(&plain, &BLOCK, &solved)?;
            let unchanged = responses.pop()?;
            let changes = (BLOCK.into_iter().zip(responses))
                .map(|(c, after)| (c, plain.get(c), plain.small_step(c), after));
            let plain = Arc::new(PlainBlock {
                changes: changes.collect(),
                unchanged,
                frames: solved.frames,
            });
            if let Some(cells) = &mut self.cells {
                cells.plain = Some(plain);
            }
        }
        Some(self)
    }

    /// The scene for parameters near those of `scene`, on its mesh.
    fn changed(&self, scene: &FemScene, from: &Parameters, to: &Parameters) -> Option<FemScene> {
        let tissue = self.guide.layers().len();
        let material = |modulus| Material::new(modulus, to.poisson_ratio).ok();
        let mut materials = vec![(tissue, material(to.block_modulus_pa)?)];
        if let Some(lump) = to.lump {
            materials.push((tissue + 1, material(lump.youngs_modulus_pa)?));
        }
        let motion = MeshMotion::new(from, to, self.guide.radius_m());
        let moved = |node: [f64; 2]| motion.moved(node);
        let is_moved = (from.lump.map(sizes), from.height_m) != (to.lump.map(sizes), to.height_m);
        let moved: Option<&dyn Fn([f64; 2]) -> [f64; 2]> =
            if is_moved { Some(&moved) } else { None };
        scene.changed(&materials, moved).ok()
    }

    /// Values of frames from their radial pressure profiles, with each inclusion on the axis, and
    /// from their forces.
    fn collect(
        &self,
        parameters: &Parameters,
        pressure: &dyn Fn(usize, f64) -> f64,
        pressure_of_second: &dyn Fn(usize, f64) -> f64,
        force: &dyn Fn(usize) -> f64,
    ) -> Vec<f64> {
        let frames = 0..self.approaches_m.len();
        let changed = |press: usize, frame: usize| {
            parameters.get(Coordinate::Pressed(press * self.approaches_m.len() + frame))
        };
        let of_frame = |frame: usize| -> Vec<f64> {
            let axial = |radius: f64| pressure(frame, radius);
            let of_second = |radius: f64| pressure_of_second(frame, radius);
            match &self.cells {
                Some(cells) => cells.pressures(frame, parameters, &axial, &of_second),
                None => self.radii_m.iter().map(|&r| axial(r)).collect(),
            }
        };
        let pressures: Vec<Vec<f64>> = frames.clone().map(of_frame).collect();
        // Exponent of the approach with which a cell's pressure grows, from the nearest frame.
        let growth = |frame: usize, cell: usize| {
            let other = if frame == 0 { 1 } else { frame - 1 };
            let exponent = pressures.get(other).map(|values| {
                let approaches = self.approaches_m[frame] / self.approaches_m[other];
                (pressures[frame][cell] / values[cell]).ln() / approaches.ln()
            });
            exponent.filter(|e| e.is_finite()).unwrap_or(1.0)
        };
        let mut values = Vec::with_capacity(self.observations());
        for frame in frames.clone() {
            values.extend(pressures[frame].iter().enumerate().map(|(cell, p)| {
                let press = (self.cells.as_ref()).map_or(0, |cells| cells.positions.presses[cell]);
                match changed(press, frame) {
                    0.0 => *p,
                    by => p * (by * growth(frame, cell)).exp(),
                }
            }));
        }
        values.extend(frames.map(|frame| force(frame) * changed(0, frame).exp()));
        values
    }

    /// Response of a solved scene to a small step of each coordinate, and to none.
    fn responses(
        &self,
        parameters: &Parameters,
        coordinates: &[Coordinate],
        solved: &Solved,
    ) -> Option<Vec<Vec<FrameResponse>>> {
        let moved = |&c: &Coordinate| parameters.moved(c, parameters.small_step(c));
        let moved: Vec<Parameters> = coordinates.iter().map(moved).collect();
        let changed = |scene: &FemScene| -> Option<Vec<FemScene>> {
            (moved.iter())
                .map(|moved| self.changed(scene, parameters, moved))
                .collect()
        };
        let approaches = |frame: usize| {
            let at = moved.iter().chain([parameters]);
            at.map(|at| self.approaches_m[frame] + at.zero_m).collect()
        };
        solved.frames.responses(changed, approaches)
    }

    /// The derivatives of a solved scene's prediction, one column per coordinate.
    ///
    /// A derivative is the difference between one iteration on the slightly changed block and one
    /// on the unchanged block, both from the solution with its tangent. It needs one factorisation
    /// per frame, and one residual per coordinate and frame. The iteration on the unchanged block
    /// cancels the residual imbalance of the solution.
    pub(crate) fn derivatives(
        &self,
        parameters: &Parameters,
        coordinates: &[Coordinate],
        solved: &Solved,
    ) -> Option<Vec<Vec<f64>>> {
        let responses = |of_second: bool| -> Option<(Vec<Coordinate>, Vec<Vec<FrameResponse>>)> {
            let named = |&coordinate: &Coordinate| match coordinate {
                Coordinate::OfSecond(coordinate) => of_second.then_some(*coordinate),
                _ => (!of_second || BLOCK.contains(&coordinate)).then_some(coordinate),
            };
            let named: Vec<Coordinate> = coordinates.iter().filter_map(named).collect();
            let named: Vec<Coordinate> = named.into_iter().filter(|c| !c.is_place()).collect();
            let found = if of_second {
                let second = solved.second.as_deref()?;
                self.responses(&parameters.swapped(), &named, second)?
            } else {
                self.responses(parameters, &named, solved)?
            };
            Some((named, found))
        };
        let (first, of_first) = responses(false)?;
        let (second, of_second) = if parameters.second.is_some() {
            responses(true)?
        } else {
            (vec![], vec![])
        };
        // The response to a step of a coordinate, or to none.
        let found = |named: &[Coordinate], c: Option<Coordinate>| {
            c.and_then(|c| named.iter().position(|named| *named == c))
                .unwrap_or(named.len())
        };
        let collect = |at: &Parameters, step: Option<Coordinate>| {
            let of_lump = |coordinate| match coordinate {
                Coordinate::OfSecond(coordinate) => *coordinate,
                coordinate => coordinate,
            };
            let is_of_second = matches!(step, Some(Coordinate::OfSecond(_)));
            let frames = &of_first[found(&first, step)];
            let step_of_second = step
                .filter(|c| is_of_second || BLOCK.contains(c))
                .map(of_lump);
            let others = of_second
                .get(found(&second, step_of_second))
                .unwrap_or(frames);
            self.collect(
                at,
                &|frame, radius| frames[frame].pressure_at(radius),
                &|frame, radius| others[frame].pressure_at(radius),
                &|frame| frames[frame].force_n(),
            )
        };
        let here = collect(parameters, None);
        let columns = coordinates.iter().map(|&coordinate| {
            let step = parameters.small_step(coordinate);
            let there = collect(&parameters.moved(coordinate, step), Some(coordinate));
            let pairs = there.iter().zip(&here);
            pairs.map(|(there, here)| (there - here) / step).collect()
        });
        Some(columns.collect())
    }
}
