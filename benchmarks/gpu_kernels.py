"""The kernels that a program compiled for a GPU launches, read from XLA's text of it.

A kernel's bytes are what it must read and write if nothing stays in a cache between kernels; what
it takes from a larger array, or puts there, counts alone. Its operations are one for each element
of each elementwise operation, whatever it is, and two for each product that is summed. A reduction
counts one for each element, or its reducer's once for each result, whichever are more.
"""

import math
import re
from typing import NamedTuple

BYTES = {"pred": 1, "s8": 1, "u8": 1, "s16": 2, "u16": 2, "f16": 2, "bf16": 2, "s64": 8, "u64": 8}
BYTES |= {"f64": 8, "c64": 8, "c128": 16}
DEFAULT_BYTES = 4
NO_KERNEL = {"parameter", "constant", "tuple", "get-tuple-element", "bitcast", "after-all"}
NO_KERNEL |= {"opt-barrier", "add-dependency", "partition-id", "replica-id"}
NO_OPERATION = NO_KERNEL | {"broadcast", "reshape", "transpose", "slice", "concatenate", "iota"}
NO_OPERATION |= {"copy", "pad", "reverse", "gather", "dynamic-slice", "dynamic-update-slice"}
TAKES = "dynamic-slice", "gather", "slice"
PUTS = "dynamic-update-slice"

COMPUTATION = re.compile(r"^(?P<entry>ENTRY )?%?(?P<name>[^\s(]+) \(.*\{$")
INSTRUCTION = re.compile(r"^\s+(?P<root>ROOT )?%(?P<name>\S+) = (?P<rest>.*)$")
SHAPE = re.compile(r"\b([a-z]+\d*)\[([\d,]*)\]")
TRIPS = re.compile(r'"known_trip_count":\{"n":"(\d+)"\}')


class Instruction(NamedTuple):
    """One of a computation; ``shapes`` are (type, dimensions) of its results."""

    name: str
    opcode: str
    shapes: list[tuple[str, tuple[int, ...]]]
    operands: list[str]
    attributes: str
    is_root: bool


class Kernel(NamedTuple):
    """A kernel, how often the program launches it, and what each launch takes."""

    name: str
    times: int
    bytes: int
    operations: int


def kernels(text: str) -> list[Kernel]:
    """All kernels of a program, of loops as often as they go round.

    A loop whose rounds the compiler does not know counts as one round.
    """
    computations, entry = parse(text)
    return list(_launched(computations, entry, 1))


def parse(text: str) -> tuple[dict[str, dict[str, Instruction]], str]:
    """The instructions of each computation, by name, and the name of the program's own."""
    computations, entry, current = {}, "", {}
    for line in text.splitlines():
        if opening := COMPUTATION.match(line):
            current = computations.setdefault(opening["name"], {})
            entry = opening["name"] if opening["entry"] else entry
        elif found := INSTRUCTION.match(line):
            instruction = _instruction(found)
            current[instruction.name] = instruction
    return computations, entry


def _instruction(found):
    result, rest = _up_to_the_end_of_type(found["rest"])
    opcode, rest = rest.strip().split("(", 1)
    operands, attributes = _bracketed("(" + rest)
    return Instruction(
        found["name"],
        opcode,
        [(t, tuple(map(int, filter(None, d.split(","))))) for t, d in SHAPE.findall(result)],
        re.findall(r"%([^\s,()]+)", operands),
        attributes,
        bool(found["root"]),
    )


def _up_to_the_end_of_type(rest):
    return _bracketed(rest) if rest.startswith("(") else rest.split(" ", 1)


def _bracketed(text):
    """What is in the bracket that text begins with, and what comes after it."""
    depth = 0
    for index, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if depth == 0:
            return text[: index + 1], text[index + 1 :]
    raise ValueError(f"a bracket without an end: {text[:60]}")


def _launched(computations, name, times):
    for instruction in computations[name].values():
        if instruction.opcode == "while":
            trips = TRIPS.search(instruction.attributes)
            rounds = times * int(trips[1]) if trips else times
            yield from _launched(computations, _called(instruction, "body"), rounds)
            if not trips:
                yield from _launched(computations, _called(instruction, "condition"), rounds)
        elif instruction.opcode in ("call", "async-start"):
            key = "to_apply" if instruction.opcode == "call" else "calls"
            yield from _launched(computations, _called(instruction, key), times)
        elif instruction.opcode == "conditional":
            names = re.findall(r"%([^\s,}]+)", instruction.attributes.split("metadata")[0])
            branches = [list(_launched(computations, branch, times)) for branch in names]
            yield from max(branches, key=len)
        elif instruction.opcode not in NO_KERNEL and not instruction.opcode.endswith("-done"):
            yield _kernel(computations, name, instruction, times)


def _called(instruction, key):
    return re.search(rf"\b{key}=%([^\s,}}]+)", instruction.attributes)[1]


def _kernel(computations, name, instruction, times):
    around = computations[name]
    if instruction.opcode == "fusion":
        inside = computations[_called(instruction, "calls")]
        moved = _bytes_of_fusion(inside)
        operations = _operations_in(computations, inside)
    else:
        given = [around[x] for x in instruction.operands]
        result = instruction._replace(shapes=instruction.shapes[:1])  # what follows is workspace
        moved = sum(map(_bytes, (*given, result)))
        operations = _operations(computations, around, instruction)
    return Kernel(instruction.name, times, moved, operations)


def _bytes_of_fusion(inside):
    parameters = [x.name for x in inside.values() if x.opcode == "parameter"]
    moved = sum(_bytes_read(inside, name) for name in parameters)
    root = next(x for x in inside.values() if x.is_root)
    results = [inside[y] for y in root.operands] if root.opcode == "tuple" else [root]
    return moved + sum(_bytes(_source(inside, y)) for y in results)


def _bytes_read(inside, name):
    """Of a parameter: all of it, unless each use of it takes a part or puts one there."""
    views = [name]
    for x in inside.values():  # in the order of their definitions
        if x.opcode == "bitcast" and x.operands[0] in views:
            views.append(x.name)
    uses = [x for x in inside.values() if x.opcode != "bitcast" and set(x.operands) & set(views)]
    parts = [x for x in uses if x.operands[0] in views and x.opcode in (*TAKES, PUTS)]
    if len(parts) < len(uses) or not uses:
        return _bytes(inside[name])
    return sum(_bytes(x) for x in parts if x.opcode in TAKES)


def _source(inside, result):
    """What a result writes: of an array that something is put into, what is put there."""
    while result.opcode == "bitcast":
        result = inside[result.operands[0]]
    return inside[result.operands[1]] if result.opcode == PUTS else result


def _bytes(instruction):
    return sum(BYTES.get(t, DEFAULT_BYTES) * math.prod(d) for t, d in instruction.shapes)


def _operations_in(computations, inside):
    return sum(_operations(computations, inside, x) for x in inside.values())


def _operations(computations, around, instruction):
    if instruction.opcode in NO_OPERATION or not instruction.shapes:
        return 0
    if instruction.opcode == "call":
        return _operations_in(computations, computations[_called(instruction, "to_apply")])
    elements = math.prod(instruction.shapes[0][1])
    if instruction.opcode == "dot" or "gemm_backend_config" in instruction.attributes:
        return 2 * elements * _summed_over(around[instruction.operands[0]], instruction.attributes)
    given = math.prod(around[instruction.operands[0]].shapes[0][1]) if instruction.operands else 0
    if instruction.opcode == "reduce":
        reducer = computations[_called(instruction, "to_apply")]
        return max(given, elements * _operations_in(computations, reducer))
    return given if instruction.opcode == "sort" else elements


def _summed_over(left, attributes):
    axes = re.search(r'lhs_contracting_dim(?:s=\{|ensions":\[)([\d,"]*)', attributes)[1].replace(
        '"', ""
    )
    return math.prod(left.shapes[0][1][int(axis)] for axis in axes.split(","))
