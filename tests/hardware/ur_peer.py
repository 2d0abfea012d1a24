"""A peer that speaks as much of Universal Robots' interfaces as ur_rtde asks of a controller.

It is no simulator of a robot: UR's own, which is one, has no torque mode. It answers the handshakes of the Real-Time
Data Exchange (port 30004) and of the dashboard server (29999), takes the control script (30002, 30003) without running
it, reports states that a test gives it, and keeps the input registers of every package: what the script would pass to
``direct_torque``.
"""

import os
import pickle
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import suppress

_VECTORS = ("q", "qd", "qdd", "current", "moment", "voltage", "TCP_pose", "TCP_speed", "TCP_force", "control_output")
_INTEGERS = {"robot_mode": "INT32", "safety_mode": "INT32", "runtime_state": "UINT32", "robot_status": "UINT32"}
_BITS = {"robot_status_bits": "UINT32", "safety_status_bits": "UINT32", "actual_digital_input_bits": "UINT64"}
_FORMATS = {"DOUBLE": "d", "INT32": "i", "UINT32": "I", "UINT64": "Q", "UINT8": "B", "BOOL": "B"}
_FORMATS |= {"VECTOR3D": "3d", "VECTOR6D": "6d", "VECTOR6INT32": "6i", "VECTOR6UINT32": "6I"}
POWERED, RUNNING, READY, DONE = {"robot_status_bits": 0b01, "runtime_state": 1}, 0b11, 1, 2
PROTECTIVE_STOP, EMERGENCY_STOP = 1 << 2, 1 << 7  # bits of the safety status
TORQUE, STOP_SCRIPT = 66, 255  # commands of ur_rtde's control script


def type_of(name):
    """The type of an RTDE variable."""
    if name in _INTEGERS or name in _BITS:
        return (_INTEGERS | _BITS)[name]
    for part, kind in (("bit_register", "BOOL"), ("int_register", "INT32"), ("bits", "UINT64"), ("mask", "UINT8")):
        if part in name:
            return kind
    if "digital_output" in name:
        return "UINT8"
    if name in ("joint_temperatures",) or name.endswith(_VECTORS) or name == "payload_inertia":
        return "VECTOR6D"
    if name == "external_force_torque":
        return "VECTOR6D"
    if name == "joint_mode":
        return "VECTOR6INT32"
    return "VECTOR3D" if name in ("actual_tool_accelerometer", "payload_cog") else "DOUBLE"


class Peer:
    """The controller's end of ur_rtde, whose arm is at row k of ``motion`` (K, 12), q and q̇, in period k."""

    def __init__(self, motion, period=2e-3):
        self.motion, self.period, self.log, self.commands, self.tick = motion, period, [], [], 0
        self.open, self._sockets, self._due = True, [], 0.0
        self.state = POWERED | {"robot_mode": 7, "safety_mode": 1, "speed_scaling": 1.0, "target_speed_fraction": 1.0}
        for port, serve in ((30004, self._rtde), (29999, self._dashboard), (30002, self._drain), (30003, self._drain)):
            self._listen(port, serve)

    def _listen(self, port, serve):
        server = socket.create_server(("127.0.0.1", port))
        self._sockets.append(server)

        def accept():
            with suppress(OSError):
                while True:
                    client, _ = server.accept()
                    self._sockets.append(client)
                    self.log.append(("connected", port))
                    threading.Thread(target=self._guard, args=(serve, client), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()

    def _guard(self, serve, client):
        with suppress(OSError, struct.error):
            serve(client)

    def close(self):
        """Drop all connections."""
        self.open = False
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()

    def _dashboard(self, client):
        client.sendall(b"Connected: Universal Robots Dashboard Server\n")
        answers = {
            b"is in remote control": b"true\n",
            b"get serial number": b"20265500001\n",
            b"PolyscopeVersion": b"URSoftware 5.26.0.0 (Jan 01 2026)\n",
        }
        while data := client.recv(1024):
            self.log.append(("dashboard", data))
            if data.strip() == b"stop":
                self.state |= POWERED
            client.sendall(answers.get(data.strip(), b"Stopped\n"))

    def _drain(self, client):
        while data := client.recv(65536):
            self.log.append(("script", data))
            self.state |= {"robot_status_bits": RUNNING, "runtime_state": 2, "output_int_register_0": READY}

    def _rtde(self, client):
        recipes, send = {}, threading.Lock()
        outputs, started = {}, threading.Event()

        def reply(kind, payload):
            with send:
                client.sendall(struct.pack(">HB", 3 + len(payload), kind) + payload)

        def stream():
            started.wait()
            due = time.monotonic()
            while self.open and started.is_set():
                self._advance()
                for number, names in list(outputs.items()):
                    with suppress(OSError):
                        reply(ord("U"), bytes([number]) + self._pack(names))
                due += self.period
                time.sleep(max(due - time.monotonic(), 0.0))

        threading.Thread(target=self._guard, args=(lambda _: stream(), client), daemon=True).start()
        file = client.makefile("rb")
        while header := file.read(3):
            size, kind = struct.unpack(">HB", header)
            payload = file.read(size - 3)
            if kind == ord("V"):
                reply(kind, b"\1")
            elif kind == ord("v"):
                reply(kind, struct.pack(">4I", 5, 26, 0, 0))
            elif kind == ord("O"):
                names = payload[8:].decode().strip(",").split(",")
                self.log.append(("outputs", names))
                outputs[len(outputs) + 1] = names
                reply(kind, bytes([len(outputs)]) + ",".join(map(type_of, names)).encode())
            elif kind == ord("I"):
                names = payload.decode().strip(",").split(",")
                self.log.append(("inputs", names))
                recipes[len(recipes) + 1] = names
                reply(kind, bytes([len(recipes)]) + ",".join(map(type_of, names)).encode())
            elif kind == ord("S"):
                reply(kind, b"\1")
                started.set()
            elif kind == ord("P"):
                started.clear()
                reply(kind, b"\1")
            elif kind == ord("U"):
                self._take(recipes[payload[0]], payload[1:])

    def _advance(self):
        """Take the arm to the next row of its motion."""
        if time.monotonic() < self._due:
            return
        self._due = max(self._due, time.monotonic() - self.period) + self.period
        row = self.motion[min(self.tick, len(self.motion) - 1)]
        self.tick += 1
        self.state |= {"timestamp": 100.0 + self.tick * self.period, "actual_q": row[:6], "actual_qd": row[6:]}

    def _pack(self, names):
        values, out = self.state, b""
        for name in names:
            fmt = _FORMATS[type_of(name)]
            count = int(fmt[0]) if fmt[0].isdigit() else 1
            value = values.get(name, 0 if count == 1 else [0] * count)
            out += struct.pack(">" + fmt, *(value if count > 1 else [value]))
        return out

    def _take(self, names, data):
        values = struct.unpack(">" + "".join(_FORMATS[type_of(name)] for name in names), data)
        flat, at = {}, 0
        for name in names:
            count = int(_FORMATS[type_of(name)][0]) if _FORMATS[type_of(name)][0].isdigit() else 1
            flat[name] = values[at : at + count] if count > 1 else values[at]
            at += count
        self.commands.append(flat)
        if flat["input_int_register_0"] == STOP_SCRIPT:
            self.state |= POWERED | {"output_int_register_0": DONE}


class PeerProcess:
    """A peer in a process of its own: ur_rtde holds the interpreter while it waits."""

    def __init__(self, motion):
        command = [sys.executable, "-S", __file__]  # it needs no packages, which would take longer to find than it runs
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._ask(motion)

    def change(self, **state):
        """Change what the controller reports, and return its log and the commands that it took."""
        return self._ask(state)

    def kill(self):
        """Let the controller vanish."""
        self._process.kill()
        self._process.communicate()

    def _ask(self, what):
        pickle.dump(what, self._process.stdin)
        self._process.stdin.flush()
        return pickle.load(self._process.stdout)


def main():
    """Serve along the motion that comes first, and take each state that comes after it, until no more can come.

    The process has real-time priority where that is allowed, as a controller has a computer of its own.
    """
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(70))
    peer = Peer(pickle.load(sys.stdin.buffer))
    with suppress(EOFError):
        while True:
            pickle.dump((peer.log, peer.commands), sys.stdout.buffer)
            sys.stdout.buffer.flush()
            peer.state |= pickle.load(sys.stdin.buffer)


if __name__ == "__main__":
    main()
