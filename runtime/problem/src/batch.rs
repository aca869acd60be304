//! Kernels collected while a scene is prepared and made callable all at once.
//!
//! One module of machine code for all terms, measures and outputs costs less than one for each: the processor's cores
//! share the work, and a kernel that several statements need is made once. Kernels handed out before
//! [`Batch::finish`] must not be run before it; what is evaluated during preparation (regions, node maps) uses the
//! backend itself.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use wfl_compiler::{
    backend::{BackendError, KernelBackend, PointKernel},
    ir::{Kernel, VerifiedKernel},
};

type Slot = Arc<OnceLock<Box<dyn PointKernel>>>;

/// A backend that puts off the work.
pub(super) struct Batch<'b> {
    backend: &'b dyn KernelBackend,
    waiting: Mutex<Vec<(VerifiedKernel, Slot)>>,
}

/// A kernel that is there after [`Batch::finish`].
struct Later(Slot);

impl PointKernel for Later {
    fn run(&self, uniforms: &[f64], inputs: &[f64], outputs: &mut [f64], n_blocks: usize) {
        self.0.get().expect("a scene is handed out after `finish`").run(uniforms, inputs, outputs, n_blocks);
    }
}

impl<'b> Batch<'b> {
    pub(super) fn new(backend: &'b dyn KernelBackend) -> Self {
        Self { backend, waiting: Mutex::new(Vec::new()) }
    }

    /// Makes all requested kernels callable.
    ///
    /// # Errors
    /// [`BackendError`] when the backend refuses one of them.
    pub(super) fn finish(&self) -> Result<(), BackendError> {
        let waiting = std::mem::take(&mut *self.waiting.lock().unwrap_or_else(PoisonError::into_inner));
        let kernels: Vec<&VerifiedKernel> = waiting.iter().map(|(k, _)| k).collect();
        for (kernel, (_, slot)) in self.backend.compile(&kernels)?.into_iter().zip(&waiting) {
            // a slot is filled once: it leaves the list here
            let _ = slot.set(kernel);
        }
        Ok(())
    }
}

/// The same instructions on the same slots; names and places in the text do not matter.
fn same(a: &Kernel, b: &Kernel) -> bool {
    a.insts == b.insts && a.outputs == b.outputs && a.n_inputs == b.n_inputs && a.n_uniforms == b.n_uniforms
}

impl KernelBackend for Batch<'_> {
    fn name(&self) -> &'static str {
        self.backend.name()
    }

    fn compile(&self, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let mut slot = |kernel: &VerifiedKernel| {
            if let Some((_, slot)) = waiting.iter().find(|(k, _)| same(k.kernel(), kernel.kernel())) {
                return slot.clone();
            }
            let slot = Slot::default();
            waiting.push((kernel.clone(), slot.clone()));
            slot
        };
        Ok(kernels.iter().map(|k| Box::new(Later(slot(k))) as Box<dyn PointKernel>).collect())
    }

    fn listing(&self, kernel: &VerifiedKernel) -> Option<String> {
        self.backend.listing(kernel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wfl_compiler::{
        InterpreterBackend,
        ir::{Inst, LANES, Val},
        verify,
    };

    /// Counts how often and for how many kernels it is called.
    #[derive(Default)]
    struct Counting(Mutex<Vec<usize>>);

    impl KernelBackend for Counting {
        fn name(&self) -> &'static str {
            "counting"
        }

        fn compile(&self, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError> {
            self.0.lock().unwrap().push(kernels.len());
            InterpreterBackend.compile(kernels)
        }

        fn listing(&self, _: &VerifiedKernel) -> Option<String> {
            None
        }
    }

    fn plus(name: &str, constant: f64) -> VerifiedKernel {
        let insts = vec![Inst::Input(0), Inst::Const(constant), Inst::Add(Val::new(0), Val::new(1))];
        let origins = vec![None; 3];
        verify(Kernel { name: name.into(), n_inputs: 1, n_uniforms: 0, insts, origins, outputs: vec![Val::new(2)] })
            .unwrap()
    }

    #[test]
    fn one_call_of_the_backend_and_no_kernel_twice() {
        let counting = Counting::default();
        let batch = Batch::new(&counting);
        let (a, b, c) = (plus("a", 1.0), plus("b", 2.0), plus("c", 1.0));
        let first = batch.compile(&[&a, &b]).unwrap();
        let second = batch.compile(&[&c]).unwrap();
        assert!(counting.0.lock().unwrap().is_empty());
        batch.finish().unwrap();
        assert_eq!(*counting.0.lock().unwrap(), [2]);
        for (kernel, sum) in first.iter().chain(&second).zip([11.0, 12.0, 11.0]) {
            let mut out = [0.0; LANES];
            kernel.run(&[], &[10.0; LANES], &mut out, 1);
            assert_eq!(out, [sum; LANES]);
        }
    }
}
