//! Follows one ray from interface to interface until its light has left or is cut off.

use super::budget::{RayOutcome, Tally};
use super::ray::{Branches, Ray, dot, normalised, sine_between};
use super::sampling::{hash, unit};
use super::{Slab, TraceOptions};
use crate::fresnel::crossing;
use crate::led::Geometry;
use crate::real::real;
use crate::surface::{Meeting, TopSurface, march};
use num_traits::{Float, FloatConst};

/// Reflections after which a ray is given up: a guided ray in a long slab needs thousands at most.
const MAX_EVENTS: u32 = 20_000;

/// The state of a trace: the scene, the sums and the random numbers.
pub(super) struct Tracer<'a, 's, T, S: ?Sized> {
    pub(super) slab: &'a Slab<'s, T>,
    pub(super) surface: &'a S,
    pub(super) options: &'a TraceOptions<T>,
    /// Gap that counts as contact with the surface.
    pub(super) tolerance: T,
    pub(super) camera_sine: T,
    pub(super) tally: Tally<T>,
    pub(super) camera_profile: &'a mut [T],
    /// State of the random numbers of the current ray.
    pub(super) stream: u64,
}

/// The next obstacle on a ray's path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Next {
    /// The slab's top.
    Top,
    /// The upper face of its layer, an interface inside the slab.
    Up,
    /// The lower face of its layer.
    Down,
    /// The edge it travels to.
    Edge,
    /// None was found: the ray creeps along the surface.
    Nothing,
}

impl<T: Float + FloatConst, S: TopSurface<T> + ?Sized> Tracer<'_, '_, T, S> {
    /// Follows a ray and all its branches.
    pub(super) fn follow(&mut self, first: Ray<T>) {
        let smallest = first.power * self.options.cutoff;
        let mut branches = Branches::new();
        let mut current = Some(first);
        while let Some(ray) = current {
            current = if ray.power <= smallest || ray.events >= MAX_EVENTS {
                self.tally.add(RayOutcome::Unresolved, ray.power);
                None
            } else {
                self.advance(ray, &mut branches)
            }
            .or_else(|| branches.pop());
        }
    }

    /// Moves the ray to its next obstacle; returns the part that continues, if any.
    pub(super) fn advance(&mut self, ray: Ray<T>, branches: &mut Branches<T>) -> Option<Ray<T>> {
        let (distance, next) = self.next(&ray);
        let mut ray = Ray {
            position: ray.at(distance),
            events: ray.events + 1,
            ..ray
        };
        match next {
            Next::Nothing => self.tally.add(RayOutcome::Unresolved, ray.power),
            Next::Edge => {
                let outcome = if ray.direction[0] > T::zero() {
                    RayOutcome::Guided
                } else {
                    RayOutcome::Returned
                };
                self.tally.add(outcome, ray.power);
            }
            Next::Top => return self.top(ray, branches),
            Next::Up => {
                ray.position[2] = self.slab.face(ray.layer);
                return self.inside(ray, ray.layer - 1, branches);
            }
            Next::Down => {
                ray.position[2] = self.slab.face(ray.layer + 1);
                let below = ray.layer + 1;
                if below < self.slab.layers.len() {
                    return self.inside(ray, below, branches);
                }
                return Some(self.bottom(ray));
            }
        }
        None
    }

    /// Distance to and kind of the nearest obstacle: edge, face of the layer, or top.
    pub(super) fn next(&self, ray: &Ray<T>) -> (T, Next) {
        let (zero, [ux, _, uz]) = (T::zero(), ray.direction);
        let edge = match ux {
            u if u > zero => (self.slab.length - ray.position[0]) / u,
            u if u < zero => ray.position[0] / -u,
            _ => T::infinity(),
        };
        let mut nearest = (edge.max(zero), Next::Edge);
        let mut offer = |distance: T, next: Next| {
            if distance < nearest.0 {
                nearest = (distance.max(zero), next);
            }
        };
        if uz < zero {
            offer(
                (self.slab.face(ray.layer + 1) - ray.position[2]) / uz,
                Next::Down,
            );
        } else if uz > zero && ray.layer > 0 {
            offer((self.slab.face(ray.layer) - ray.position[2]) / uz, Next::Up);
        }
        if ray.layer > 0 {
            return nearest;
        }
        match self.meet_top(ray, nearest.0) {
            Meeting::At(distance) => (distance, Next::Top),
            Meeting::Missed => nearest,
            Meeting::Undecided => (zero, Next::Nothing),
        }
    }

    /// Where the ray meets the top before the distance `limit`: the plane z = 0 outside the surface's support, the surface
    /// itself inside.
    fn meet_top(&self, ray: &Ray<T>, limit: T) -> Meeting<T> {
        let zero = T::zero();
        let ([x, _, z], [ux, _, uz]) = (ray.position, ray.direction);
        let [left, right] = self.surface.support();
        let plane = if uz > zero {
            ((-z) / uz).max(zero)
        } else {
            T::infinity()
        };
        // The part of the path inside the support.
        let (enter, leave) = if ux == zero {
            if x >= left && x <= right {
                (zero, limit)
            } else {
                (T::infinity(), T::infinity())
            }
        } else {
            let (a, b) = ((left - x) / ux, (right - x) / ux);
            (a.min(b).max(zero), a.max(b))
        };
        let meets_plane = |distance: T| {
            if distance <= limit {
                Meeting::At(distance)
            } else {
                Meeting::Missed
            }
        };
        if left >= right || leave <= zero || plane < enter {
            return meets_plane(plane);
        }
        if enter > limit {
            return Meeting::Missed;
        }
        match march(
            self.surface,
            &ray.position,
            &ray.direction,
            [enter, leave.min(limit)],
            self.tolerance,
        ) {
            Meeting::Missed => meets_plane(plane.max(leave)),
            met => met,
        }
    }

    /// Splits a ray at the top: the transmitted part leaves, or enters the touching object and is scattered back or absorbed.
    fn top(&mut self, mut ray: Ray<T>, branches: &mut Branches<T>) -> Option<Ray<T>> {
        let [x, y, _] = ray.position;
        let [left, right] = self.surface.support();
        let deformed = x > left && x < right;
        let [gx, gy] = if deformed {
            self.surface.gradient(x, y)
        } else {
            [T::zero(); 2]
        };
        ray.position[2] = if deformed {
            self.surface.height(x, y)
        } else {
            T::zero()
        };
        let normal = normalised([-gx, -gy, T::one()]);
        let object = if deformed {
            self.surface.touching(x, y)
        } else {
            None
        };
        let outside = object.map_or(self.slab.ambient, |o| o.index);
        let transmitted = ray.power * self.transmittance(&ray, &normal, outside);
        match object {
            None => self.tally.add(RayOutcome::Above, transmitted),
            Some(object) => {
                let scattered = transmitted * object.albedo;
                self.tally
                    .add(RayOutcome::Absorbed, transmitted - scattered);
                let direction = self.scatter(&normal);
                self.keep(
                    Ray {
                        direction,
                        power: scattered,
                        ..ray
                    },
                    branches,
                );
            }
        }
        Some(ray.mirrored(&normal, ray.power - transmitted))
    }

    /// Splits a ray at the bottom: the transmitted part leaves, towards the camera or past it.
    fn bottom(&mut self, ray: Ray<T>) -> Ray<T> {
        let normal = [T::zero(), T::zero(), T::one()];
        let transmitted = ray.power * self.transmittance(&ray, &normal, self.slab.ambient);
        let sine = ray.direction[0].hypot(ray.direction[1]);
        let seen = self.slab.layers[ray.layer].index * sine <= self.slab.ambient * self.camera_sine;
        self.tally.add(
            if seen {
                RayOutcome::Camera
            } else {
                RayOutcome::Below
            },
            transmitted,
        );
        if seen && !self.camera_profile.is_empty() {
            let bins = self.camera_profile.len();
            let share = ray.position[0] / self.slab.length * real(bins as f64);
            let bin = share.to_usize().unwrap_or(0).min(bins - 1);
            self.camera_profile[bin] = self.camera_profile[bin] + transmitted;
        }
        ray.mirrored(&normal, ray.power - transmitted)
    }

    /// Splits a ray at an interface inside the slab: the refracted part continues, the reflected part waits as a branch.
    fn inside(&mut self, ray: Ray<T>, beyond: usize, branches: &mut Branches<T>) -> Option<Ray<T>> {
        let normal = [T::zero(), T::zero(), T::one()];
        let (n1, n2) = (
            self.slab.layers[ray.layer].index,
            self.slab.layers[beyond].index,
        );
        let [ux, uy, uz] = ray.direction;
        let (sine, cosine) = (ux.hypot(uy), uz.abs());
        let Some((share, along)) = crossing(n1, n2, sine, cosine) else {
            return Some(ray.mirrored(&normal, ray.power));
        };
        let transmitted = ray.power * share.min(T::one());
        self.keep(ray.mirrored(&normal, ray.power - transmitted), branches);
        let ratio = n1 / n2;
        let direction = normalised([ux * ratio, uy * ratio, (along / n2).copysign(uz)]);
        Some(Ray {
            direction,
            layer: beyond,
            power: transmitted,
            ..ray
        })
    }

    fn transmittance(&self, ray: &Ray<T>, normal: &[T; 3], outside: T) -> T {
        let inside = self.slab.layers[ray.layer].index;
        let cosine = dot(&ray.direction, normal).abs().min(T::one());
        let sine = sine_between(&ray.direction, normal);
        crossing(inside, outside, sine, cosine).map_or(T::zero(), |(share, _)| share.min(T::one()))
    }

    /// Stores a branch for later, or counts it as unresolved when the stack is full.
    fn keep(&mut self, ray: Ray<T>, branches: &mut Branches<T>) {
        if ray.power > T::zero() && !branches.push(ray) {
            self.tally.add(RayOutcome::Unresolved, ray.power);
        }
    }

    /// A direction into the slab by Lambert's law about the surface's inward normal.
    fn scatter(&mut self, normal: &[T; 3]) -> [T; 3] {
        self.stream = hash(self.stream);
        let u = unit::<T>(self.stream);
        if self.options.geometry == Geometry::Section {
            let across = u + u - T::one();
            let inward = ((T::one() - across) * (T::one() + across)).sqrt();
            return normalised([
                -inward * normal[0] + across * normal[2],
                T::zero(),
                -inward * normal[2] - across * normal[0],
            ]);
        }
        self.stream = hash(self.stream);
        let (sin, cos) = (unit::<T>(self.stream) * (T::PI() + T::PI())).sin_cos();
        let (radius, inward) = (u.sqrt(), (T::one() - u).sqrt());
        // Two directions in the tangent plane; the normal is never along x.
        let first = normalised([normal[2], T::zero(), -normal[0]]);
        let second = [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ];
        normalised(core::array::from_fn(|k| {
            radius * (cos * first[k] + sin * second[k]) - inward * normal[k]
        }))
    }
}
