"""LLVM code that copies rows of a batch into blocks of L lanes and back."""

from __future__ import annotations


def copies(lanes: int) -> str:
    """Text of take_W and give_W for one lane and for ``lanes``, and what they need."""
    widths = [1] if lanes == 1 else [lanes, 1]
    return "".join(taking(w) + giving(w) for w in widths) + (
        "\ndeclare ptr @malloc(i64)\ndeclare void @free(ptr)"
    )


def taking(lanes: int) -> str:
    """Text of ``take_L(block, x, step, rows, count)``: rows of a batch into a block."""
    places = "".join(
        f"""
  %in{i} = icmp slt i64 {i}, %count
  %at{i} = select i1 %in{i}, i64 {i}, i64 %end"""
        for i in range(lanes)
    )
    moves = "".join(
        f"""
  %f{i} = getelementptr double, ptr %row, i64 %at{i}
  %v{i} = load double, ptr %f{i}, align 8
  %g{i} = getelementptr double, ptr %out, i64 {i}
  store double %v{i}, ptr %g{i}, align 8"""
        for i in range(lanes)
    )
    part = f"""
part:
  %end = sub i64 %count, 1{places}
  br label %some
some:
  %r = phi i64 [ 0, %part ], [ %r2, %some2 ]
  %busy = icmp slt i64 %r, %rows
  br i1 %busy, label %some2, label %done
some2:
  %shift = mul i64 %r, %step
  %row = getelementptr double, ptr %x, i64 %shift
  %base = mul i64 %r, {lanes}
  %out = getelementptr double, ptr %block, i64 %base{moves}
  %r2 = add i64 %r, 1
  br label %some"""
    head = f"take_{lanes}(ptr noalias %block, ptr noalias %x, i64 %step, i64 %rows, i64 %count)"
    return copying(head, "%x", "%block", lanes, part)


def giving(lanes: int) -> str:
    """Text of ``give_L(y, block, step, rows, count)``: rows of a block into a batch."""
    part = f"""
part:
  br label %some
some:
  %r = phi i64 [ 0, %part ], [ %r2, %some4 ]
  %busy = icmp slt i64 %r, %rows
  br i1 %busy, label %some2, label %done
some2:
  %shift = mul i64 %r, %step
  %row = getelementptr double, ptr %y, i64 %shift
  %base = mul i64 %r, {lanes}
  %out = getelementptr double, ptr %block, i64 %base
  br label %some3
some3:
  %i = phi i64 [ 0, %some2 ], [ %i2, %some3 ]
  %f = getelementptr double, ptr %out, i64 %i
  %v = load double, ptr %f, align 8
  %g = getelementptr double, ptr %row, i64 %i
  store double %v, ptr %g, align 8
  %i2 = add i64 %i, 1
  %on = icmp slt i64 %i2, %count
  br i1 %on, label %some3, label %some4
some4:
  %r2 = add i64 %r, 1
  br label %some"""
    head = f"give_{lanes}(ptr noalias %y, ptr noalias %block, i64 %step, i64 %rows, i64 %count)"
    return copying(head, "%block", "%y", lanes, part)


def copying(head: str, source: str, target: str, lanes: int, part: str) -> str:
    """Copy whole rows where every lane counts, else do as ``part`` says."""
    vector = "double" if lanes == 1 else f"<{lanes} x double>"
    stepped, blocked = "%wide_step", f"{lanes}"
    near, far = (stepped, blocked) if source == "%x" else (blocked, stepped)
    near_align, far_align = (8, 8 * lanes) if source == "%x" else (8 * lanes, 8)
    return f"""
define internal void @{head} noinline nounwind {{
entry:
  %wide_step = add i64 %step, 0
  %full = icmp eq i64 %count, {lanes}
  br i1 %full, label %whole, label %part
whole:
  %q = phi i64 [ 0, %entry ], [ %q2, %whole2 ]
  %go = icmp slt i64 %q, %rows
  br i1 %go, label %whole2, label %done
whole2:
  %a = mul i64 %q, {near}
  %b = mul i64 %q, {far}
  %pa = getelementptr double, ptr {source}, i64 %a
  %pb = getelementptr double, ptr {target}, i64 %b
  %value = load {vector}, ptr %pa, align {near_align}
  store {vector} %value, ptr %pb, align {far_align}
  %q2 = add i64 %q, 1
  br label %whole{part}
done:
  ret void
}}"""
