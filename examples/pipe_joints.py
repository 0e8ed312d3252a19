"""Drives a robot through a pipe, as a program in any language can: no closedchain is imported here.

    python pipe_joints.py linear_delta

The first input swings about home by a tenth of a radian or metre; a line for each of 100 steps says
where all joints are, and how far the loops are open.
"""

import json
import math
import subprocess
import sys

robot = sys.argv[1] if len(sys.argv) > 1 else "linear_delta"
told = subprocess.run(["closedchain", "info", robot, "--json"], capture_output=True, check=True)
driven = json.loads(told.stdout)["inputs"][0]
command = ["closedchain", "joints", robot]
with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as pipe:
    for step in range(100):
        value = driven["home"] + 0.1 * math.sin(2.0 * math.pi * step / 100)
        print(json.dumps({driven["name"]: value}), file=pipe.stdin, flush=True)
        answer = json.loads(pipe.stdout.readline())
        if not answer.get("arrived"):
            print(answer.get("error") or answer["message"], file=sys.stderr)
            continue
        joints = zip(answer["name"], answer["position"], strict=True)
        places = " ".join(f"{name}={position:.4f}" for name, position in joints)
        print(f"{places} open by {answer['residual']:.0e}")
    pipe.stdin.close()
