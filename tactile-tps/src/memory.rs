//! What a method keeps from one item of a series for the next.

use core::any::Any;

/// Memory of one method along a series, for [`WarpModel::jacobians_through`](crate::WarpModel::jacobians_through) and others like it.
///
/// What is in it belongs to the method, which asks for its own type with [`state`](Self::state). A method that finds what another one left
/// starts anew.
///
/// ```
/// use tactile_tps::Memory;
/// let mut memory = Memory::default();
/// memory.state::<Vec<f64>>().push(7.0);
/// assert_eq!(memory.state::<Vec<f64>>(), &[7.0]);
/// assert_eq!(memory.state::<String>(), "", "another method's");
/// assert!(memory.state::<Vec<f64>>().is_empty());
/// ```
#[derive(Default)]
pub struct Memory {
    state: Option<Box<dyn Any + Send + Sync>>,
}

impl Memory {
    /// The state of type `S` that was left here; a default one where there is none, or one of another type.
    pub fn state<S: Default + Send + Sync + 'static>(&mut self) -> &mut S {
        let kept = self.state.take().and_then(|state| state.downcast().ok());
        let state: Box<S> = kept.unwrap_or_default();
        match self.state.insert(state).downcast_mut() {
            Some(state) => state,
            None => unreachable!("the state was put there as this type"),
        }
    }
}

impl core::fmt::Debug for Memory {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Memory")
            .field("is_empty", &self.state.is_none())
            .finish()
    }
}
