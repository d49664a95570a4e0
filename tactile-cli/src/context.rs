//! What every subcommand has at hand.
use crate::console::Console;
use crate::interrupt::Interrupt;
use crate::memory::Memory;

pub struct Context {
    pub console: Console,
    pub interrupt: Interrupt,
    pub memory: Memory,
}

impl Context {
    pub fn new(json: bool, memory_gb: f64) -> Self {
        Self {
            console: Console::new(json),
            interrupt: Interrupt::install(),
            memory: Memory::of_gigabytes(memory_gb),
        }
    }
}
