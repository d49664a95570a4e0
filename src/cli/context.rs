//! What every subcommand has at hand.
use crate::cli::arguments::Program;
use crate::cli::console::Console;
use crate::cli::interrupt::Interrupt;
use crate::cli::memory::Memory;

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
