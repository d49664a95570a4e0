//! A ray and a small stack of them.

use num_traits::{Float, FloatConst};

/// A ray in a layer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray<T> {
    pub(crate) position: [T; 3],
    pub(crate) direction: [T; 3],
    pub(crate) layer: usize,
    pub(crate) power: T,
    pub(crate) events: u32,
}

impl<T: Float + FloatConst> Ray<T> {
    /// The point at the distance `t` along the ray.
    pub(crate) fn at(&self, t: T) -> [T; 3] {
        core::array::from_fn(|k| self.position[k] + t * self.direction[k])
    }

    /// The ray mirrored at a plane with unit normal `n`, `power` left.
    pub(crate) fn mirrored(&self, n: &[T; 3], power: T) -> Self {
        let along = dot(&self.direction, n);
        let direction = core::array::from_fn(|k| self.direction[k] - (along + along) * n[k]);
        Self {
            direction: normalised(direction),
            power,
            ..*self
        }
    }
}

pub(crate) fn dot<T: Float + FloatConst>(a: &[T; 3], b: &[T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn normalised<T: Float + FloatConst>(v: [T; 3]) -> [T; 3] {
    let length = dot(&v, &v).sqrt();
    v.map(|c| c / length)
}

/// Sine of the angle between unit vectors, accurate when small.
pub(crate) fn sine_between<T: Float + FloatConst>(a: &[T; 3], b: &[T; 3]) -> T {
    let x = a[1] * b[2] - a[2] * b[1];
    let y = a[2] * b[0] - a[0] * b[2];
    let z = a[0] * b[1] - a[1] * b[0];
    (x * x + y * y + z * z).sqrt().min(T::one())
}

/// Branches waiting to be followed; a fixed size, so that tracing never allocates.
#[derive(Debug)]
pub(crate) struct Branches<T> {
    rays: [Option<Ray<T>>; 32],
    count: usize,
}

impl<T: Float + FloatConst> Branches<T> {
    pub(crate) fn new() -> Self {
        Self {
            rays: [None; 32],
            count: 0,
        }
    }

    /// Stores a ray; false when the stack is full.
    pub(crate) fn push(&mut self, ray: Ray<T>) -> bool {
        let Some(slot) = self.rays.get_mut(self.count) else {
            return false;
        };
        *slot = Some(ray);
        self.count += 1;
        true
    }

    pub(crate) fn pop(&mut self) -> Option<Ray<T>> {
        self.count = self.count.checked_sub(1)?;
        self.rays[self.count].take()
    }
}
