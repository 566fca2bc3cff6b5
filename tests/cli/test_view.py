# SPDX-License-Identifier: Apache-2.0
"""The viewer's server against clients that are malformed, oversized, slow or foreign; no browser."""
import base64
import json
import os
import resource
import shlex
import signal
import socket
import struct
import subprocess
import time
import unittest
from pathlib import Path
from urllib.parse import urlsplit

from program import BIN, Case, default_signals, run, sphere_points, write_ply

PAGE = Path(BIN).resolve().parent.parent / "share/pointfair/web/index.html"
QUIET = 20  # seconds; the server closes a connection that sends no whole header after 10


def frame(payload, opcode=1, mask=b"\1\2\3\4", final=True):
    """A frame of a WebSocket client."""
    head = bytes([(0x80 if final else 0) | opcode])
    length = len(payload)
    if length < 126:
        head += bytes([0x80 | length])
    elif length < 65536:
        head += bytes([0x80 | 126]) + struct.pack(">H", length)
    else:
        head += bytes([0x80 | 127]) + struct.pack(">Q", length)
    return head + mask + bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))


class Client:
    """A socket to the server."""

    def __init__(self, url, timeout=QUIET):
        self.parts = urlsplit(url)
        self.socket = socket.create_connection((self.parts.hostname, self.parts.port), timeout=timeout)
        self.data = b""

    def close(self):
        self.socket.close()

    def send(self, data):
        self.socket.sendall(data)

    def more(self):
        """Reads on; False at the end of the connection."""
        try:
            data = self.socket.recv(1 << 20)
        except ConnectionResetError:
            data = b""
        self.data += data
        return bool(data)

    def take(self, count):
        while len(self.data) < count:
            if not self.more():
                raise ConnectionError("closed")
        taken, self.data = self.data[:count], self.data[count:]
        return taken

    def header(self):
        while b"\r\n\r\n" not in self.data:
            if not self.more():
                raise ConnectionError("closed")
        header, self.data = self.data.split(b"\r\n\r\n", 1)
        return header.decode()

    def request(self, target="/", method="GET", body=b"", **headers):
        """Sends a request; the status and the header of the answer."""
        names = {"Host": self.parts.netloc, **{k.replace("_", "-"): v for k, v in headers.items()}}
        if body:
            names.setdefault("Content-Length", len(body))
        lines = [f"{method} {target} HTTP/1.1"] + [f"{k}: {v}" for k, v in names.items() if v is not None]
        self.send("\r\n".join(lines).encode() + b"\r\n\r\n" + body)
        header = self.header()
        return int(header.split()[1]), header

    def upgrade(self, target="/session", **headers):
        key = base64.b64encode(os.urandom(16)).decode()
        given = {"Origin": f"http://{self.parts.netloc}", **headers}
        return self.request(target, Upgrade="websocket", Connection="Upgrade", Sec_WebSocket_Key=key,
                            Sec_WebSocket_Version="13", **given)[0]

    def message(self):
        """The head of the next message of the session."""
        while True:
            opcode, length = self.take(2)
            if length == 126:
                length = struct.unpack(">H", self.take(2))[0]
            elif length == 127:
                length = struct.unpack(">Q", self.take(8))[0]
            payload = self.take(length)
            if opcode & 15 == 8:
                raise ConnectionError("closed")
            if opcode & 15 == 2:
                return json.loads(payload[4:4 + struct.unpack("<I", payload[:4])[0]])

    def message_of(self, kind):
        while True:
            head = self.message()
            if head["type"] == kind:
                return head

    def is_closed(self, within=QUIET):
        """Whether the server ends the connection; what it still sends is passed over."""
        self.socket.settimeout(within)
        try:
            while self.more():
                pass
            return True
        except TimeoutError:
            return False


@unittest.skipUnless(PAGE.exists(), "the page is not built: npm or the network was missing")
class View(Case):
    def setUp(self):
        super().setUp()
        self.cloud = write_ply(self.path("in.ply"), sphere_points(2000, 0.01))
        self.url = self.start(self.cloud)

    def start(self, cloud, *words):
        process = subprocess.Popen([BIN, "view", str(cloud), "--no-open", "--port", "0", "--save-folder", str(self.folder),
                                    *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=default_signals)
        self.addCleanup(self.stop, process)
        self.process = process
        return process.stdout.readline().decode().strip()

    def stop(self, process):
        process.terminate()
        process.wait(20)
        process.stdout.close()
        process.stderr.close()

    def client(self, url=None, **options):
        client = Client(url or self.url, **options)
        self.addCleanup(client.close)
        return client

    def session(self, target="/session"):
        client = self.client()
        self.assertEqual(client.upgrade(target), 101)
        client.message_of("cloud")
        return client

    def assert_alive(self):
        """A proper page still gets its answer."""
        client = self.session()
        client.send(frame(b'{"type":"run","id":5,"params":{"k":"8","iterations":"1"}}'))
        self.assertEqual(client.message_of("result")["id"], 5)
        client.close()

    def test_the_page_and_its_files(self):
        status, header = self.client().request("/")
        self.assertEqual(status, 200)
        self.assertIn("text/html", header)
        for word in ("Content-Security-Policy: default-src 'none'", "X-Content-Type-Options: nosniff",
                     "Referrer-Policy: no-referrer"):
            self.assertIn(word, header)
        self.assertEqual(self.client().request("/", method="HEAD")[0], 200)
        self.assertEqual(self.client().request("/", method="PUT")[0], 405)
        self.assertEqual(self.client().request("/session")[0], 403)  # no Origin
        self.assertEqual(self.client().request("/session", Origin=f"http://{urlsplit(self.url).netloc}")[0], 426)

    def test_paths_lead_nowhere_else(self):
        for target in ("/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2fetc/passwd", "//etc/passwd",
                       "/assets/../../../../etc/passwd", "/index.html/", "/.git", "/assets", "/in.ply"):
            self.assertEqual(self.client().request(target)[0], 404, target)

    def test_a_session_answers(self):
        self.assert_alive()

    def test_foreign_origins_and_names_are_refused(self):
        netloc = urlsplit(self.url).netloc
        for origin in ("http://evil.example", f"http://{netloc}.evil.example", "null", "http://127.0.0.1", None):
            self.assertEqual(self.client().upgrade(Origin=origin), 403, origin)
        for host in ("evil.example", f"evil.example:{urlsplit(self.url).port}", "", None):
            self.assertEqual(self.client().upgrade(Host=host, Origin=f"http://{host}"), 403, host)
            self.assertEqual(self.client().request("/", Host=host)[0], 403, host)
        self.assertEqual(self.client().request("/upload?name=a.ply", "POST", b"x", Origin="http://evil.example")[0], 403)
        self.assert_alive()

    def test_elsewhere_and_on_wish_a_token_is_asked_for(self):
        for words in (["--token"], ["--host", "0.0.0.0"]):
            url = self.start(self.cloud, *words)
            token = urlsplit(url).query
            self.assertRegex(token, r"^token=[0-9a-f]{32}$")
            local = f"http://127.0.0.1:{urlsplit(url).port}/"
            self.assertEqual(self.client(local).request("/")[0], 200)  # the page itself holds nothing
            for target in ("/session", "/session?token=", "/session?" + token[:-1], "/session?" + token + "0"):
                self.assertEqual(self.client(local).upgrade(target), 403, target)
            self.assertEqual(self.client(local).upgrade("/session?" + token), 101)

    def test_malformed_requests_end_their_connection_only(self):
        for data in (b"\0\1\2\3" * 10 + b"\r\n\r\n", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"\r\n" * 100,
                     b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: -5\r\n\r\n",
                     b"GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\nContent-Length: 5\r\n\r\n\xff"):
            client = self.client()
            client.send(data)
            self.assertTrue(client.is_closed(), data)
        self.assert_alive()

    def test_oversized_headers_are_refused(self):
        client = self.client()
        client.send(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"a" * 100000)
        self.assertTrue(client.is_closed())
        self.assert_alive()

    def test_malformed_frames_end_their_connection_only(self):
        unmasked = bytes([0x81, 2]) + b"{}"
        reserved = bytes([0xf1]) + frame(b"{}")[1:]
        for data in (unmasked, reserved, frame(b"{}", opcode=5), frame(b"{}", opcode=2), frame(b"\xff\xfe\xff"),
                     frame(b"x" * 70000), bytes([0x81, 0xff]) + struct.pack(">Q", 1 << 60) + b"\0\0\0\0",
                     frame(b"x" * 200, opcode=9)):
            client = self.session()
            client.send(data)
            self.assertTrue(client.is_closed(), data[:20])
        self.assert_alive()

    def test_messages_that_are_wrong_are_answered_in_words(self):
        client = self.session()
        for text in (b"{", b"[]", b'{"type":"run","params":{"k":"x"}}', b'{"type":"save","id":1,"output":"../a.ply"}', b"[" * 60000):
            client.send(frame(text))
            self.assertTrue(client.message_of("error")["message"])
        client.send(frame(b'{"type":"run","id":9,"params":{"k":"8"}}'))
        self.assertEqual(client.message_of("result")["id"], 9)

    def test_the_command_reads_the_file_as_it_was_read(self):
        rows = "".join(f"{i} {x:.6f} {y:.6f} {z:.6f}\n" for i, (x, y, z) in enumerate(sphere_points(500, 0.01)))
        self.path("in.txt").write_text("scan\n" + rows)
        self.url = self.start(self.path("in.txt"), "--columns", "id,x,y,z", "--skip", "1")
        client = self.session()
        client.send(frame(b'{"type":"run","id":1,"params":{"k":"8"}}'))
        words = shlex.split(client.message_of("result")["command"])
        self.ok(*words[1:], "-q", cwd=self.folder)
        self.assertEqual(self.report("info", self.path("denoised.ply"))["points"], 500)

    def test_a_message_may_come_in_pieces(self):
        client = self.session()
        client.send(frame(b'{"type":"run","id":3,', final=False) + frame(b"hi", opcode=9))
        client.send(frame(b'"params":{"k":"8"}}', opcode=0))
        self.assertEqual(client.message_of("result")["id"], 3)

    def test_clients_that_send_no_whole_header_are_let_go(self):
        slow = [self.client() for _ in range(80)]  # more than the server keeps
        for client in slow:
            try:
                client.send(b"GET / HTTP/1.1\r\nHost: ")
            except OSError:
                pass
        begin = time.monotonic()
        self.assertTrue(all(client.is_closed() for client in slow))
        self.assertLess(time.monotonic() - begin, QUIET)
        self.assert_alive()

    def test_a_server_without_free_file_handles_rests_and_goes_on_when_there_are(self):
        handles = len(os.listdir(f"/proc/{self.process.pid}/fd"))
        resource.prlimit(self.process.pid, resource.RLIMIT_NOFILE, (handles + 5, handles + 5))
        clients = [self.client() for _ in range(20)]  # of which the server can accept 5
        time.sleep(0.3)
        begin = self.processor_seconds()
        time.sleep(2)
        self.assertLess(self.processor_seconds() - begin, 0.5)
        for client in clients:
            client.close()
        self.assert_alive()

    def processor_seconds(self):
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def test_a_page_that_does_not_read_is_replaced_by_the_next(self):
        stuck = self.session()
        for i in range(2000):
            stuck.send(frame(b'{"type":"run","id":%d,"params":{"k":"8","iterations":"%d"}}' % (i, 1 + i % 2)))
        self.assert_alive()

    def test_a_new_page_takes_over(self):
        first = self.session()
        self.session()
        self.assertEqual(first.message_of("taken")["type"], "taken")
        self.assertTrue(first.is_closed())

    def test_a_file_sent_by_the_page_is_shown(self):
        page = self.session()
        other = write_ply(self.path("other.ply"), sphere_points(100, 0.01))
        origin = f"http://{urlsplit(self.url).netloc}"
        status, _ = self.client().request("/upload?name=other.ply", "POST", other.read_bytes(), Origin=origin)
        self.assertEqual(status, 202)
        cloud = page.message_of("cloud")
        self.assertEqual((cloud["name"], cloud["points"], cloud["path"]), ("other.ply", 100, ""))
        status, _ = self.client().request("/upload?name=big.ply", "POST", b"x", Origin=origin, Content_Length=1 << 40)
        self.assertEqual(status, 413)
        self.assertEqual(self.client().request("/upload", Origin=origin)[0], 405)
        self.assert_alive()

    def test_saving_stays_in_its_folder(self):
        client = self.session()
        client.send(frame(b'{"type":"save","id":1,"output":"denoised.ply","params":{"k":"8"}}'))
        self.assertEqual(client.message_of("saved")["path"], str(self.path("denoised.ply")))
        self.ok("run", self.cloud, self.path("again.ply"), "--k=8", "--device=cpu")
        self.assertEqual(self.path("again.ply").read_bytes(), self.path("denoised.ply").read_bytes())

    def test_an_interrupt_ends_it(self):
        client = self.session()
        client.send(frame(b'{"type":"run","id":1,"params":{"k":"200","iterations":"100"}}'))
        time.sleep(0.2)
        self.process.send_signal(signal.SIGINT)
        self.process.wait(60)
        self.assertEqual(self.process.returncode, 130)
        self.assertEqual(self.process.stderr.read(), b"pointfair: interrupted\n")

    def test_arguments_that_cannot_be(self):
        self.fails(3, "view", self.path("none.ply"), "--no-open", says="none.ply")
        self.fails(2, "view", "-", "--no-open", says="needs a file")
        self.fails(2, "view", "--no-open", "--viewpoint", "0,0,0", says="name the file")
        says = ["--viewpoint", "no attribute 'vx'"]
        self.fails(2, "view", self.cloud, "--no-open", "--port", 0, "--viewpoint", "vx,vy,vz", says=says)
        self.fails(2, "view", self.cloud, "--port", "99999")
        taken = str(urlsplit(self.url).port)
        self.fails(1, "view", self.cloud, "--no-open", "--port", taken, says="choose another --port")
        self.fails(1, "view", self.cloud, "--no-open", "--host", "no.such.host.invalid", says="--host")
        self.fails(1, "view", self.cloud, "--no-open", "--host", "192.0.2.1", says="choose another --host")  # of no machine
        self.fails(3, "view", self.cloud, "--no-open", "--save-folder", self.path("none"), says="--save-folder")


@unittest.skipIf(PAGE.exists(), "the page is built")
class NoPage(Case):
    def test_what_is_missing_is_said(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        self.fails(1, "view", cloud, "--no-open", says="npm")
