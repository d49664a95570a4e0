//! What every subcommand has at hand.
use crate::arguments::Program;
use crate::console::Console;
use crate::interrupt::Interrupt;
use crate::memory::Memory;

pub struct Context {
    pub console: Console,
    pub interrupt: Interrupt,
    pub memory: Memory,
}

impl Context {
    pub fn new(program: &Program) -> Self {
        Self {
            console: Console::new(program.json),
            interrupt: Interrupt::install(),
            memory: Memory::of_gigabytes(program.memory_gb),
        }
    }
}
