//! Verified kernels to Cranelift's intermediate form.
//!
//! One function per kernel: a loop over blocks, inside a loop over pairs of lanes (or single lanes where the host
//! has no vectors of two), inside the instructions once, with constant offsets. Rules of the translation:
//! - each instruction becomes the IEEE operation of the same name; nothing is fused, sums keep their order;
//! - masks are integer vectors of all ones or zeros, `select` is a choice by bits;
//! - functions of `math.rs` are called lane by lane; matrix functions read and write stack slots;
//! - inputs, uniforms and constants are loaded near each use instead of being kept in registers ([`REUSE`]), and
//!   outputs are stored as soon as they are known: point laws have far more values than a machine has registers;
//! - instructions stand in the order in which outputs ask for them ([`order`]); what no output needs is left out.

use std::collections::BTreeSet;

use cranelift_codegen::{
    Context,
    control::ControlPlane,
    ir::{
        self, AbiParam, Block, ConstantData, FuncRef, InstBuilder, MemFlagsData, StackSlot, StackSlotData,
        StackSlotKind, Type, Value, condcodes::FloatCC, types,
    },
    isa::TargetIsa,
};
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext};
use wfl_compiler::{
    ir::{Compare, Inst, Kernel, LANES, Val, VerifiedKernel},
    lookup::{CurveRef, Reading},
};

use crate::shim::Shim;

/// How many lanes one machine value holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Width {
    /// Two: vectors of 128 bits.
    Pair,
    /// One: for machines without such vectors.
    One,
}

impl Width {
    fn lanes(self) -> usize {
        match self {
            Width::Pair => 2,
            Width::One => 1,
        }
    }

    fn number(self) -> Type {
        match self {
            Width::Pair => types::F64X2,
            Width::One => types::F64,
        }
    }
}

/// A loaded value is used again as long as its last use is at most this many instructions back; then it is loaded
/// again, which costs as much as reloading a spilled register but no store. Measured on kernels of 500 to 3000
/// instructions: any number from 4 to 30 gives code of the same speed, keeping all loads costs 10 to 20 % more time
/// to compile.
const REUSE: usize = 12;

/// Bytes of one number.
const NUMBER: usize = size_of::<f64>();

/// `fn(uniforms, inputs, outputs, n_blocks)`, nothing returned.
pub(crate) fn signature(isa: &dyn TargetIsa) -> ir::Signature {
    let mut signature = ir::Signature::new(isa.default_call_conv());
    signature.params.extend([AbiParam::new(isa.pointer_type()); 4]);
    signature
}

/// The functions that a kernel calls, each once.
pub(crate) fn shims_of(kernel: &VerifiedKernel) -> BTreeSet<Shim> {
    kernel.kernel().insts.iter().filter_map(shim_of).collect()
}

fn shim_of(inst: &Inst) -> Option<Shim> {
    match inst {
        Inst::Call1(f, _) => Some(Shim::One(*f)),
        Inst::Call2(f, ..) => Some(Shim::Two(*f)),
        Inst::Matrix { function, .. } => Some(Shim::Matrix(*function)),
        Inst::Lookup(_, reading, _) => Some(Shim::Table(*reading)),
        _ => None,
    }
}

/// Writes the body of `function`; `import` declares a function to call in it.
pub(crate) fn emit(
    kernel: &VerifiedKernel,
    width: Width,
    isa: &dyn TargetIsa,
    function: &mut ir::Function,
    context: &mut FunctionBuilderContext,
    import: &mut dyn FnMut(&mut ir::Function, Shim) -> FuncRef,
) {
    let shims = shims_of(kernel).into_iter().map(|shim| (shim, import(function, shim))).collect();
    let mut builder = FunctionBuilder::new(function, context);
    emit_loops(&mut builder, kernel.kernel(), width, isa.pointer_type(), shims);
    builder.seal_all_blocks();
    builder.finalize(isa.frontend_config());
}

/// Whether the code generator accepts every instruction at this width.
pub(crate) fn is_supported(isa: &dyn TargetIsa, width: Width) -> bool {
    let mut context = Context::new();
    context.func.signature = signature(isa);
    emit_probe(&mut context.func, width, isa);
    context.compile(isa, &mut ControlPlane::default()).is_ok()
}

/// A function with every operation on machine values that [`Body`] uses.
fn emit_probe(function: &mut ir::Function, width: Width, isa: &dyn TargetIsa) {
    let v = Val::new;
    let compare = |op| Inst::Compare(op, v(0), v(1));
    let insts = vec![
        Inst::Input(0),
        Inst::Uniform(0),
        Inst::Const(1.5),
        compare(Compare::Less),
        compare(Compare::LessEqual),
        compare(Compare::Equal),
        compare(Compare::NotEqual),
        Inst::And(v(3), v(4)),
        Inst::Or(v(5), v(6)),
        Inst::Not(v(7)),
        Inst::And(v(8), v(9)),
        Inst::Select(v(10), v(0), v(2)),
        Inst::Add(v(11), v(0)),
        Inst::Sub(v(12), v(1)),
        Inst::Mul(v(13), v(2)),
        Inst::Div(v(14), v(0)),
        Inst::Neg(v(15)),
        Inst::Abs(v(16)),
        Inst::Sqrt(v(17)),
        Inst::Call1(wfl_compiler::MathFn1::Exp, v(18)),
    ];
    let outputs = vec![v(insts.len() - 1)];
    let probe =
        Kernel { name: "probe".into(), n_inputs: 1, n_uniforms: 1, origins: vec![None; insts.len()], insts, outputs };
    let signature = function.import_signature(Shim::One(wfl_compiler::MathFn1::Exp).signature(isa));
    let name = ir::ExternalName::testcase(b"exp");
    let exp = function.import_function(ir::ExtFuncData { name, signature, colocated: false, patchable: false });
    let mut context = FunctionBuilderContext::new();
    let mut builder = FunctionBuilder::new(function, &mut context);
    let shims = vec![(Shim::One(wfl_compiler::MathFn1::Exp), exp)];
    emit_loops(&mut builder, &probe, width, isa.pointer_type(), shims);
    builder.seal_all_blocks();
    builder.finalize(isa.frontend_config());
}

/// The loops:
/// ```text
/// entry:            if n_blocks == 0 goto done
/// block(in, out, n):              goto lanes(in, out, 8 / width)
/// lanes(in, out, left): body;     if left - 1 > 0 goto lanes(in + width, out + width, left - 1)
/// next:             if n - 1 > 0 goto block(in of the next block, out of the next block, n - 1)
/// done:             return
/// ```
fn emit_loops(b: &mut FunctionBuilder<'_>, kernel: &Kernel, width: Width, pointer: Type, shims: Vec<(Shim, FuncRef)>) {
    let [entry, block, lanes, next, done] = std::array::from_fn(|_| b.create_block());
    b.append_block_params_for_function_params(entry);
    let params: Vec<Value> = b.block_params(entry).to_vec();
    let (uniforms, n_blocks) = (params[0], params[3]);
    let block_params = three(b, block, pointer);
    let lane_params = three(b, lanes, pointer);

    b.switch_to_block(entry);
    b.ins().brif(n_blocks, block, &[params[1].into(), params[2].into(), n_blocks.into()], done, &[]);

    b.switch_to_block(block);
    let count = b.ins().iconst(pointer, bytes(LANES / width.lanes()));
    b.ins().jump(lanes, &[block_params[0].into(), block_params[1].into(), count.into()]);

    b.switch_to_block(lanes);
    let [inputs, outputs, left] = lane_params;
    Body::new(b, kernel, width, shims, [uniforms, inputs, outputs]).emit();
    let step = bytes(width.lanes() * NUMBER);
    let next_inputs = b.ins().iadd_imm_s(inputs, step);
    let next_outputs = b.ins().iadd_imm_s(outputs, step);
    let fewer = b.ins().iadd_imm_s(left, -1);
    b.ins().brif(fewer, lanes, &[next_inputs.into(), next_outputs.into(), fewer.into()], next, &[]);

    b.switch_to_block(next);
    let inputs = b.ins().iadd_imm_s(block_params[0], bytes(kernel.n_inputs * LANES * NUMBER));
    let outputs = b.ins().iadd_imm_s(block_params[1], bytes(kernel.outputs.len() * LANES * NUMBER));
    let fewer = b.ins().iadd_imm_s(block_params[2], -1);
    b.ins().brif(fewer, block, &[inputs.into(), outputs.into(), fewer.into()], done, &[]);

    b.switch_to_block(done);
    b.ins().return_(&[]);
}

fn three(b: &mut FunctionBuilder<'_>, block: Block, ty: Type) -> [Value; 3] {
    std::array::from_fn(|_| b.append_block_param(block, ty))
}

fn bytes(n: usize) -> i64 {
    i64::try_from(n).expect("the verifier bounds slots so that a block has less than 2^31 bytes")
}

/// What a kernel value is in the function.
#[derive(Clone, Copy)]
enum Emitted {
    /// Not reached, or not yet emitted.
    Nothing,
    /// A number or a mask.
    Value(Value),
    /// A load or a constant, with the place of its last use.
    Loaded(Value, usize),
    /// Results of a matrix function, in memory.
    Slot(StackSlot),
}

/// The instructions of a kernel, for the lanes at the current pointers.
struct Body<'a, 'f> {
    b: &'a mut FunctionBuilder<'f>,
    kernel: &'a Kernel,
    width: Width,
    shims: Vec<(Shim, FuncRef)>,
    uniforms: Value,
    inputs: Value,
    outputs: Value,
    emitted: Vec<Emitted>,
    /// Output slots by the value they show, sorted.
    stores: Vec<(usize, usize)>,
    /// Entries of the matrix functions.
    entries: Option<StackSlot>,
    flags: MemFlagsData,
    /// How many instructions have been emitted.
    step: usize,
}

impl<'a, 'f> Body<'a, 'f> {
    fn new(
        b: &'a mut FunctionBuilder<'f>,
        kernel: &'a Kernel,
        width: Width,
        shims: Vec<(Shim, FuncRef)>,
        [uniforms, inputs, outputs]: [Value; 3],
    ) -> Self {
        let outputs_of = kernel.outputs.iter().enumerate();
        let mut stores: Vec<(usize, usize)> = outputs_of.map(|(slot, v)| (v.index(), slot)).collect();
        stores.sort_unstable();
        let emitted = vec![Emitted::Nothing; kernel.insts.len()];
        let flags = MemFlagsData::new().with_notrap();
        Self { b, kernel, width, shims, uniforms, inputs, outputs, emitted, stores, entries: None, flags, step: 0 }
    }

    fn emit(mut self) {
        for (step, at) in order(self.kernel, &self.stores).into_iter().enumerate() {
            self.step = step;
            // Loads are emitted where they are used.
            if !is_load(&self.kernel.insts[at]) {
                self.emitted[at] = self.instruction(&self.kernel.insts[at]);
            }
            let first = self.stores.partition_point(|(v, _)| *v < at);
            for k in first..self.stores.len() {
                let (v, slot) = self.stores[k];
                if v != at {
                    break;
                }
                let value = self.value(Val::new(at));
                self.b.ins().store(self.flags, value, self.outputs, offset(slot * LANES));
            }
        }
    }

    fn instruction(&mut self, inst: &Inst) -> Emitted {
        let value = match inst {
            Inst::Const(_) | Inst::Input(_) | Inst::Uniform(_) => self.load(inst),
            Inst::Add(a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().fadd(a, c)
            }
            Inst::Sub(a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().fsub(a, c)
            }
            Inst::Mul(a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().fmul(a, c)
            }
            Inst::Div(a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().fdiv(a, c)
            }
            Inst::Neg(a) => {
                let a = self.value(*a);
                self.b.ins().fneg(a)
            }
            Inst::Abs(a) => {
                let a = self.value(*a);
                self.b.ins().fabs(a)
            }
            Inst::Sqrt(a) => {
                let a = self.value(*a);
                self.b.ins().sqrt(a)
            }
            Inst::Compare(op, a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().fcmp(condition(*op), a, c)
            }
            Inst::And(a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().band(a, c)
            }
            Inst::Or(a, c) => {
                let (a, c) = (self.value(*a), self.value(*c));
                self.b.ins().bor(a, c)
            }
            Inst::Not(a) => self.not(*a),
            Inst::Select(m, a, c) => self.select(*m, *a, *c),
            Inst::Call1(f, a) => self.call_lanes(Shim::One(*f), None, &[*a]),
            Inst::Call2(f, a, c) => self.call_lanes(Shim::Two(*f), None, &[*a, *c]),
            Inst::Lookup(curve, reading, a) => self.lookup(curve, *reading, *a),
            Inst::Part(bundle, part) => self.part(*bundle, *part as usize),
            Inst::Matrix { function, n, entries } => {
                let n = usize::from(*n);
                return Emitted::Slot(self.matrix(Shim::Matrix(*function), n, function.n_results(n), entries));
            }
        };
        Emitted::Value(value)
    }

    /// One result of a matrix function.
    fn part(&mut self, bundle: Val, part: usize) -> Value {
        let Emitted::Slot(slot) = self.emitted[bundle.index()] else {
            unreachable!("the verifier lets parts read bundles only")
        };
        let (pointer, ty) = (self.pointer(), self.width.number());
        self.b.ins().stack_load(pointer, ty, slot, offset(part * self.width.lanes()))
    }

    /// The value of an operand; loads are made or made again here.
    fn value(&mut self, v: Val) -> Value {
        let inst = &self.kernel.insts[v.index()];
        match self.emitted[v.index()] {
            Emitted::Value(value) => value,
            Emitted::Loaded(value, last) if self.step - last <= REUSE => {
                self.emitted[v.index()] = Emitted::Loaded(value, self.step);
                value
            }
            Emitted::Loaded(..) | Emitted::Nothing if is_load(inst) => {
                let value = self.load(inst);
                self.emitted[v.index()] = Emitted::Loaded(value, self.step);
                value
            }
            _ => unreachable!("the verifier lets numbers and masks be used after their definition only"),
        }
    }

    fn load(&mut self, inst: &Inst) -> Value {
        match inst {
            Inst::Input(slot) => {
                let offset = offset(*slot as usize * LANES);
                self.b.ins().load(self.width.number(), self.flags, self.inputs, offset)
            }
            Inst::Uniform(slot) => {
                let x = self.b.ins().load(types::F64, self.flags, self.uniforms, offset(*slot as usize));
                self.splat(x)
            }
            Inst::Const(c) => match self.width {
                Width::One => self.b.ins().f64const(*c),
                Width::Pair => {
                    let half = c.to_le_bytes();
                    let data: ConstantData = [half, half].concat().into();
                    let constant = self.b.func.dfg.constants.insert(data);
                    self.b.ins().vconst(types::F64X2, constant)
                }
            },
            _ => unreachable!("only loads come here"),
        }
    }

    fn splat(&mut self, x: Value) -> Value {
        match self.width {
            Width::One => x,
            Width::Pair => self.b.ins().splat(types::F64X2, x),
        }
    }

    fn not(&mut self, a: Val) -> Value {
        let a = self.value(a);
        match self.width {
            // Scalar masks are 0 or 1.
            Width::One => self.b.ins().bxor_imm_u(a, 1),
            Width::Pair => self.b.ins().bnot(a),
        }
    }

    fn select(&mut self, m: Val, a: Val, c: Val) -> Value {
        let (m, a, c) = (self.value(m), self.value(a), self.value(c));
        match self.width {
            Width::One => self.b.ins().select(m, a, c),
            Width::Pair => {
                let order = MemFlagsData::new().with_endianness(ir::Endianness::Little);
                let bits = self.b.ins().bitcast(types::F64X2, order, m);
                self.b.ins().bitselect(bits, a, c)
            }
        }
    }

    fn shim(&self, shim: Shim) -> FuncRef {
        let found = self.shims.iter().find(|(s, _)| *s == shim);
        found.expect("every function that the kernel calls was imported").1
    }

    /// A reading of a curve, whose address is a constant of the code.
    fn lookup(&mut self, curve: &CurveRef, reading: Reading, a: Val) -> Value {
        let pointer = self.pointer();
        let address = i64::try_from(curve.address().addr()).expect("addresses of user space are positive");
        let curve = self.b.ins().iconst(pointer, address);
        self.call_lanes(Shim::Table(reading), Some(curve), &[a])
    }

    /// A function of numbers, lane by lane; `first` goes before them.
    fn call_lanes(&mut self, shim: Shim, first: Option<Value>, operands: &[Val]) -> Value {
        let callee = self.shim(shim);
        let operands: Vec<Value> = operands.iter().map(|v| self.value(*v)).collect();
        if self.width == Width::One {
            let args: Vec<Value> = first.into_iter().chain(operands).collect();
            let call = self.b.ins().call(callee, &args);
            return self.b.inst_results(call)[0];
        }
        let [low, high] = [0, 1].map(|lane| {
            let lanes = operands.iter().map(|v| self.b.ins().extractlane(*v, lane));
            let args: Vec<Value> = first.into_iter().chain(lanes).collect();
            let call = self.b.ins().call(callee, &args);
            self.b.inst_results(call)[0]
        });
        let low = self.b.ins().scalar_to_vector(types::F64X2, low);
        self.b.ins().insertlane(low, high, 1)
    }

    /// Number k of lane l stands at `k * lanes + l` in both slots.
    fn matrix(&mut self, shim: Shim, n: usize, n_results: usize, entries: &[Val]) -> StackSlot {
        let callee = self.shim(shim);
        let lanes = self.width.lanes();
        let pointer = self.pointer();
        let from = match self.entries {
            Some(slot) => slot,
            None => self.slot(9 * lanes),
        };
        self.entries = Some(from);
        for (k, v) in entries.iter().enumerate() {
            let value = self.value(*v);
            self.b.ins().stack_store(pointer, value, from, offset(k * lanes));
        }
        let to = self.slot(n_results * lanes);
        let args = [
            self.b.ins().iconst(pointer, bytes(n)),
            self.b.ins().iconst(pointer, bytes(lanes)),
            self.b.ins().stack_addr(pointer, from, 0),
            self.b.ins().stack_addr(pointer, to, 0),
        ];
        self.b.ins().call(callee, &args);
        to
    }

    fn pointer(&self) -> Type {
        self.b.func.dfg.value_type(self.uniforms)
    }

    fn slot(&mut self, numbers: usize) -> StackSlot {
        let size = u32::try_from(numbers * NUMBER).expect("at most 81 numbers in 2 lanes");
        // Aligned to 2^4 bytes, one vector.
        self.b.create_sized_stack_slot(StackSlotData::new(StackSlotKind::ExplicitSlot, size, 4))
    }
}

/// The offset in bytes of number `idx`.
fn offset(idx: usize) -> i32 {
    i32::try_from(idx * NUMBER).expect("the verifier bounds slots so that offsets stay below 2^31")
}

fn is_load(inst: &Inst) -> bool {
    matches!(inst, Inst::Const(_) | Inst::Input(_) | Inst::Uniform(_))
}

fn condition(op: Compare) -> FloatCC {
    match op {
        Compare::Less => FloatCC::LessThan,
        Compare::LessEqual => FloatCC::LessThanOrEqual,
        Compare::Equal => FloatCC::Equal,
        Compare::NotEqual => FloatCC::NotEqual,
    }
}

/// The instructions that outputs need, in an order that keeps few values alive: depth first from each output, in the
/// order in which the kernel defines them. Rearranging whole instructions changes no bit of any result.
fn order(kernel: &Kernel, stores: &[(usize, usize)]) -> Vec<usize> {
    let mut order = Vec::with_capacity(kernel.insts.len());
    let mut done = vec![false; kernel.insts.len()];
    // Instructions to do; with a mark when their operands are done.
    let mut open: Vec<(usize, bool)> = Vec::new();
    for (output, _) in stores {
        open.push((*output, false));
        while let Some((at, ready)) = open.pop() {
            if done[at] {
                continue;
            }
            if ready {
                done[at] = true;
                order.push(at);
                continue;
            }
            open.push((at, true));
            let first = open.len();
            kernel.insts[at].for_each_operand(|v| open.push((v.index(), false)));
            // The first operand on top.
            open[first..].reverse();
        }
    }
    order
}
