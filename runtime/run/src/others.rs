//! What ranks that have parts of the mesh write of a step: the first one writes the files of all.
//!
//! Promises: the first rank has the pieces of one other rank at a time.

use std::sync::mpsc::SyncSender;

use wfl_discrete::finite::BadOutput;
use wfl_host::team::Team;
use wfl_mesh::mesh::Mesh;
use wfl_output::{
    Piece,
    bytes::{Reader, Unreadable, Writer},
};

fn to_bytes(pieces: &[Piece]) -> Vec<u8> {
    let mut w = Writer::default();
    w.list(pieces, |w, piece| piece.write_to(w));
    w.bytes
}

fn from_bytes(bytes: &[u8]) -> Vec<Piece> {
    Reader::new(bytes).list(Piece::read_from).expect("pieces as they were sent")
}

/// The pieces of all ranks on the first one, one rank's behind the other's; none on the others. Those of a whole mesh
/// stay what they are.
pub(super) fn pieces_of_all(pieces: Vec<Piece>, mesh: &Mesh) -> Vec<Piece> {
    let team = mesh.holders();
    if team.is_alone() {
        return pieces;
    }
    team.at_first(&to_bytes(&pieces)).iter().flat_map(|bytes| from_bytes(bytes)).collect()
}

/// Sends the pieces of each grid to the first rank, which passes those of the others on. Ends where nobody takes them any
/// more.
pub(super) fn pass_on(grids: &[&[Piece]], team: &dyn Team, writer: Option<&SyncSender<Vec<Piece>>>) -> Option<()> {
    for pieces in grids {
        let own = if team.rank() == 0 { Vec::new() } else { to_bytes(pieces) };
        let mut taken = Some(());
        team.each_at_first(&own, &mut |rank, bytes| {
            if rank > 0 && taken.is_some() {
                taken = writer.and_then(|writer| writer.send(from_bytes(&bytes)).ok());
            }
        });
        taken?;
    }
    Some(())
}

/// What is not finite in the outputs of all ranks, each quantity once, on the first one; the others keep their own.
pub(super) fn bad_of_all(own: Vec<BadOutput>, mesh: &Mesh) -> Vec<BadOutput> {
    let team = mesh.holders();
    if team.is_alone() {
        return own;
    }
    let mut w = Writer::default();
    w.list(&own, |w, bad| {
        let [x, y, z] = bad.position;
        w.text(&bad.what);
        w.numbers(&[bad.time, bad.value, x, y, z]);
    });
    let read = |r: &mut Reader<'_>| {
        let what = r.text()?;
        let [time, value, x, y, z] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(BadOutput { what, time, value, position: [x, y, z] })
    };
    let mut all: Vec<BadOutput> = if team.rank() == 0 { Vec::new() } else { own };
    for bytes in team.at_first(&w.bytes) {
        for bad in Reader::new(&bytes).list(read).expect("what was sent") {
            if all.iter().all(|known| known.what != bad.what) {
                all.push(bad);
            }
        }
    }
    all
}
