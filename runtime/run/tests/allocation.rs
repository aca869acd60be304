//! After the first time assembly allocates nothing: counted on the nine scenes whose speed is measured.

#[expect(dead_code, reason = "the benchmark prints more about a case than this suite asks for")]
#[path = "../benches/assembly/cases.rs"]
mod cases;
#[path = "../benches/common/scene.rs"]
mod common;

use cases::{CASES, Problem};

/// Allocations of `work` on the thread it runs on, a pool of one: there every batch is computed by the caller.
fn allocations(work: impl FnOnce() + Send) -> u64 {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| allocation_counter::measure(work).count_total)
}

#[test]
fn allocations_are_seen() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1.0; 100]))), 1);
}

#[test]
fn assembly_allocates_only_the_first_time() {
    for case in &CASES {
        let mut problem = Problem::new(case).expect("a scene");
        let mut both = || {
            problem.assemble().expect("finite numbers");
            problem.assemble_residual().expect("finite numbers");
        };
        allocations(&mut both);
        let again = allocations(&mut both);
        assert_eq!(again, 0, "{}: {again} allocations", case.name);
    }
}
