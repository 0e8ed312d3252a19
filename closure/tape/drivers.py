"""LLVM code around a body: whole batches, and loops that repeat a body until every lane is done.

Postures are taken in blocks of L lanes. A block is copied into memory of the call, row by row, and
its results are copied out; a last block that is not full repeats its last posture, and a single
posture left over goes through the code for one lane, where there is some. Nothing is shared between
calls.
"""

from __future__ import annotations

from dataclasses import dataclass

from closedchain.closure.tape.copies import copies

STACK = 1 << 17
"""Bytes of scratch memory taken from the stack; what needs more asks the system for it."""


@dataclass(frozen=True)
class Memory:
    """Rows that a call holds for one block.

    Attributes
    ----------
    inputs, outputs : int
        Rows of the body's own inputs and outputs.
    parameters : int
        Rows of inputs that stay as they are while a loop runs.
    scratch : int
        Rows that pieces of the body pass values through.
    """

    inputs: int
    outputs: int
    parameters: int
    scratch: int


def batch(memory: Memory, widths: tuple[int, ...]) -> str:
    """Text of ``run(x, y, n, step_x, step_y)``: every posture of a batch.

    Row k of x is at x + 8 k step_x, and so for y. ``y`` must not overlap ``x``. There is code for
    each of ``widths``: for the lanes of a block, and for one lane unless only blocks are asked for.
    """
    sizes, lanes = (memory.inputs, memory.outputs, memory.scratch), widths[0]
    direct = """
  %alone = icmp eq i64 %n, 1
  br i1 %alone, label %one, label %apart
one:
  %plain_x = icmp eq i64 %step_x, 1
  %plain_y = icmp eq i64 %step_y, 1
  %plain = and i1 %plain_x, %plain_y
  br i1 %plain, label %direct, label %apart
direct:
  call void @body_1(ptr %x, ptr %x, ptr %y, ptr %m2)
  br label %done"""
    blind = "\n  br label %apart"
    inner = [
        f"""
  call void @take_W(ptr %m0, ptr %from, i64 %step_x, i64 {memory.inputs}, i64 %count)
  call void @body_W(ptr %m0, ptr %m0, ptr %m1, ptr %m2)
  call void @give_W(ptr %to, ptr %m1, i64 %step_y, i64 {memory.outputs}, i64 %count)""".replace(
            "_W", f"_{w}"
        )
        for w in widths
    ]
    head = "define void @run(ptr %x, ptr %y, i64 %n, i64 %step_x, i64 %step_y) nounwind {"
    places = """
  %from = getelementptr double, ptr %x, i64 %k
  %to = getelementptr double, ptr %y, i64 %k"""
    return (
        head
        + allocated(sizes, lanes)
        + (direct if 1 in widths else blind)
        + blocks("apart", lanes, places, inner)
        + released(sizes, lanes)
        + "\n}"
        + packed("run", 5)
        + copies(lanes)
    )


def loop(memory: Memory, widths: tuple[int, ...]) -> str:
    """Text of ``loop(s, p, n, step_s, step_p, most)``: the body repeated on states in place.

    The body's outputs are the new state and whether the lane still runs. A block is finished when
    none of its lanes runs, or after ``most`` repetitions. ``widths`` as for ``batch``.
    """
    states, lanes = memory.inputs, widths[0]
    sizes = (states + 1, states + 1, memory.parameters, memory.scratch)
    inner = [
        ticking(states, memory.parameters, w).replace("_W", f"_{w}").replace("#", mark)
        for w, mark in zip(widths, ("_wide", "_lone"), strict=False)
    ]
    head = (
        "define void @loop(ptr %s, ptr %p, i64 %n, i64 %step_s, i64 %step_p, i64 %most) nounwind {"
    )
    places = """
  %from = getelementptr double, ptr %s, i64 %k
  %given = getelementptr double, ptr %p, i64 %k"""
    return (
        head
        + allocated(sizes, lanes)
        + """
  %any = icmp sgt i64 %most, 0
  br i1 %any, label %apart, label %done"""
        + blocks("apart", lanes, places, inner)
        + released(sizes, lanes)
        + "\n}"
        + packed("loop", 6)
        + copies(lanes)
    )


def packed(name: str, count: int) -> str:
    """Text of ``name_packed(a)``: the function with its arguments at an address."""
    reads = "".join(
        f"""
  %p{k} = getelementptr i64, ptr %a, i64 {k}
  %a{k} = load i64, ptr %p{k}, align 8"""
        for k in range(count)
    )
    given = ", ".join(["ptr %x", "ptr %y", *(f"i64 %a{k}" for k in range(2, count))])
    return f"""
define void @{name}_packed(ptr %a) nounwind {{
entry:{reads}
  %x = inttoptr i64 %a0 to ptr
  %y = inttoptr i64 %a1 to ptr
  call void @{name}({given})
  ret void
}}"""


def ticking(states: int, parameters: int, lanes: int) -> str:
    """One block of a loop: states go from one memory to the other and back."""
    vector = "double" if lanes == 1 else f"<{lanes} x double>"
    zero = "0.0" if lanes == 1 else "zeroinitializer"
    truths = "i1" if lanes == 1 else f"<{lanes} x i1>"
    some = (
        "%some# = or i1 %runs#, false"
        if lanes == 1
        else f"%mask# = bitcast {truths} %runs# to i{lanes}\n  %some# = icmp ne i{lanes} %mask#, 0"
    )
    return f"""
  call void @take_W(ptr %m0, ptr %from, i64 %step_s, i64 {states}, i64 %count)
  call void @take_W(ptr %m2, ptr %given, i64 %step_p, i64 {parameters}, i64 %count)
  br label %enter#
enter#:
  br label %tick#
tick#:
  %t# = phi i64 [ 1, %enter# ], [ %t2#, %tick# ]
  %old# = phi ptr [ %m0, %enter# ], [ %new#, %tick# ]
  %new# = phi ptr [ %m1, %enter# ], [ %old#, %tick# ]
  call void @body_W(ptr %old#, ptr %m2, ptr %new#, ptr %m3)
  %flag# = getelementptr double, ptr %new#, i64 {states * lanes}
  %last# = load {vector}, ptr %flag#, align {8 * lanes}
  %runs# = fcmp une {vector} %last#, {zero}
  {some}
  %early# = icmp slt i64 %t#, %most
  %t2# = add i64 %t#, 1
  %again# = and i1 %some#, %early#
  br i1 %again#, label %tick#, label %leave#
leave#:
  call void @give_W(ptr %from, ptr %new#, i64 %step_s, i64 {states}, i64 %count)"""


def blocks(entry: str, lanes: int, places: str, inner: list[str]) -> str:
    """Go over the postures in blocks of ``lanes``, and one by itself where one is left.

    ``inner`` is what to do with a block and, if there is code for one lane, with one by itself.
    """
    split = "label %wide"
    narrow = ""
    if len(inner) > 1:
        split = "i1 %lone, label %narrow, label %wide"
        narrow = f"\nnarrow:{inner[1]}\n  br label %tail"
    return f"""
{entry}:
  br label %head
head:
  %k = phi i64 [ 0, %{entry} ], [ %next, %tail ]
  %left = sub i64 %n, %k
  %more = icmp sgt i64 %left, 0
  br i1 %more, label %block, label %done
block:{places}
  %full = icmp sge i64 %left, {lanes}
  %count = select i1 %full, i64 {lanes}, i64 %left
  %lone = icmp eq i64 %count, 1
  br {split}
wide:{inner[0]}
  br label %tail{narrow}
tail:
  %next = add i64 %k, {lanes}
  br label %head"""


def allocated(sizes: tuple[int, ...], lanes: int) -> str:
    """Memory for rows of a block, as %m0, %m1, ..., on the stack or, where large, from the heap."""
    starts = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
    total = max(1, starts[-1] * lanes)
    if total * 8 <= STACK:
        text = f"\nentry:\n  %all = alloca [{total} x double], align 64"
    else:
        text = (
            f"\nentry:\n  %heap = call ptr @malloc(i64 {total * 8 + 64})"
            "\n  %raw = ptrtoint ptr %heap to i64\n  %up = add i64 %raw, 63"
            "\n  %even = and i64 %up, -64\n  %all = inttoptr i64 %even to ptr"
        )
    for k, start in enumerate(starts[:-1]):
        text += f"\n  %m{k} = getelementptr double, ptr %all, i64 {start * lanes}"
    return text


def released(sizes: tuple[int, ...], lanes: int) -> str:
    """End of the function."""
    large = sum(sizes) * lanes * 8 > STACK
    free = "\n  call void @free(ptr %heap)" if large else ""
    return f"\ndone:{free}\n  ret void"
