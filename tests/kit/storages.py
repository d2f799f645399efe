"""Small stand-ins for storages, on the loopback: a web server, Google Cloud Storage, Azure blobs.

Each serves files of a dictionary (name -> bytes) that a test may change meanwhile, and only as much of its protocol as
listing, reading by ranges and, but for the web server, writing what is not there yet take.
"""

from __future__ import annotations

import hashlib
import json
import re
import threading
from contextlib import contextmanager
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, unquote, urlsplit

if TYPE_CHECKING:
    from collections.abc import Iterator

Files = dict[str, bytes]
_CHANGED = "Thu, 01 Oct 2026 08:00:00 GMT"


class _Server(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    files: Files
    lock: threading.Lock
    taken = 412  # the status for what is there, and must not be

    def log_message(self, *_: object) -> None:
        """Say nothing."""

    def do_HEAD(self) -> None:
        """Answer without the content."""
        self.do_GET()

    def send(self, data: bytes, kind: str = "application/octet-stream", status: int = 200, **headers: str) -> None:
        """Send data, or the range of it that was asked for."""
        asked = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("x-ms-range") or self.headers.get("Range") or "")
        whole = len(data)
        if asked and status == 200:
            first, last = int(asked[1]), min(int(asked[2] or whole - 1), whole - 1)
            if first >= whole:
                data, status = b"", 416
            else:
                data, status = data[first : last + 1], 206
                headers["Content_Range"] = f"bytes {first}-{last}/{whole}"
        self.send_response(status)
        for name, value in {"Content_Type": kind, "Accept_Ranges": "bytes", **headers}.items():
            self.send_header(name.replace("_", "-"), value)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def do_PUT(self) -> None:
        """Keep what is sent, unless it must not be there yet and is."""
        data = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        key, only_new = self.key(), self.headers.get("If-None-Match") or self.headers.get("x-goog-if-generation-match")
        with self.lock:
            if only_new and key in self.files:
                self.send(b"", status=self.taken, x_ms_error_code="BlobAlreadyExists")
                return
            self.files[key] = data
        self.send(b"", status=201, ETag=f'"{etag(data)}"', Last_Modified=_CHANGED)

    def do_DELETE(self) -> None:
        """Forget a file."""
        self.send(b"", status=202 if self.files.pop(self.key(), None) is not None else 404)

    def key(self) -> str:
        """Return the name of the file that is asked for."""
        raise NotImplementedError

    def below(self, prefix: str, delimiter: str) -> tuple[list[str], list[str]]:
        """Return the names below a prefix, and the folders among them."""
        names, folders = [], set()
        for name in sorted(self.files):
            if name.startswith(prefix):
                folder, found, _ = name.removeprefix(prefix).partition(delimiter or "\0")
                if found:
                    folders.add(f"{prefix}{folder}{delimiter}")
                else:
                    names.append(name)
        return names, sorted(folders)


def etag(data: bytes) -> str:
    """Return what stands for the version of some bytes."""
    return hashlib.sha256(data).hexdigest()[:16]


class _Web(_Server):
    def do_GET(self) -> None:
        name = unquote(self.path).strip("/")
        if name in self.files:
            self.send(self.files[name], ETag=f'"{etag(self.files[name])}"')
            return
        names, folders = self.below(f"{name}/" if name else "", "/")
        links = "".join(f'<a href="/{escape(one)}">{escape(one)}</a>\n' for one in (*folders, *names))
        self.send(links.encode(), "text/html", 200 if links else 404)


class _Google(_Server):
    """Its API in JSON, which fsspec speaks, and the one in XML, which Delta speaks."""

    def key(self) -> str:
        return unquote("/".join(urlsplit(self.path).path.split("/")[2:]))

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        asked = {name: values[0] for name, values in parse_qs(parts.query).items()}
        if "/b/" not in parts.path:
            self._xml(asked)
            return
        _, _, key = parts.path.partition("/o/")
        key = unquote(key)
        if key and key not in self.files:
            self.send(b'{"error": {"code": 404, "message": "no such object"}}', "application/json", 404)
        elif key and asked.get("alt") == "media":
            self.send(self.files[key])
        elif key:
            self._tell(self._item(key))
        elif parts.path.endswith("/o"):
            names, folders = self.below(asked.get("prefix", ""), asked.get("delimiter", ""))
            self._tell({"items": [self._item(name) for name in names], "prefixes": folders})
        else:
            self._tell({"name": "logs"})

    def _xml(self, asked: dict[str, str]) -> None:
        key = self.key()
        if "list-type" in asked:
            names, folders = self.below(asked.get("prefix", ""), asked.get("delimiter", ""))
            files = "".join(
                f"<Contents><Key>{escape(name)}</Key><Size>{len(self.files[name])}</Size>"
                f"<LastModified>2026-10-01T08:00:00.000Z</LastModified><ETag>{etag(self.files[name])}</ETag></Contents>"
                for name in names
                if name > asked.get("start-after", "")
            )
            files += "".join(f"<CommonPrefixes><Prefix>{escape(one)}</Prefix></CommonPrefixes>" for one in folders)
            self.send(f"<ListBucketResult>{files}</ListBucketResult>".encode(), "application/xml")
        elif key in self.files:
            self.send(self.files[key], ETag=f'"{etag(self.files[key])}"', Last_Modified=_CHANGED)
        else:
            self.send(b"", status=404)

    def _item(self, name: str) -> dict[str, Any]:
        data = self.files[name]
        return {
            "name": name, "bucket": "logs", "size": str(len(data)), "etag": etag(data), "generation": "1",
            "updated": "2026-10-01T08:00:00.000Z", "timeCreated": "2026-10-01T08:00:00.000Z",
        }  # fmt: skip

    def _tell(self, what: dict[str, Any]) -> None:
        self.send(json.dumps(what).encode(), "application/json")


class _Azure(_Server):
    taken = 409

    def key(self) -> str:
        return unquote("/".join(urlsplit(self.path).path.split("/")[3:]))

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        asked = {name: values[0] for name, values in parse_qs(parts.query).items()}
        key = self.key()
        if asked.get("comp") == "list":
            names, folders = self.below(asked.get("prefix", ""), asked.get("delimiter", ""))
            blobs = "".join(f"<Blob><Name>{escape(name)}</Name>{self._about(name)}</Blob>" for name in names)
            blobs += "".join(f"<BlobPrefix><Name>{escape(one)}</Name></BlobPrefix>" for one in folders)
            text = f'<EnumerationResults ContainerName="logs"><Blobs>{blobs}</Blobs><NextMarker/></EnumerationResults>'
            self.send(text.encode(), "application/xml")
        elif key in self.files:
            data = self.files[key]
            told = {"ETag": f'"{etag(data)}"', "Last_Modified": _CHANGED, "x_ms_blob_type": "BlockBlob"}
            self.send(data, **told)
        elif not key:
            self.send(b"", ETag='"0"', Last_Modified=_CHANGED)
        else:
            self.send(b"", status=404, x_ms_error_code="BlobNotFound")

    def _about(self, name: str) -> str:
        data = self.files[name]
        return (
            f"<Properties><Last-Modified>{_CHANGED}</Last-Modified><Etag>{etag(data)}</Etag><BlobType>BlockBlob</BlobType>"
            f"<Content-Length>{len(data)}</Content-Length><Content-Type>application/octet-stream</Content-Type>"
            "</Properties>"
        )


SERVERS = {"web": _Web, "google": _Google, "azure": _Azure}


@contextmanager
def serving(kind: str, files: Files) -> Iterator[int]:
    """Serve files as `web`, `google` or `azure` do; yield the port."""
    handler = type("Handler", (SERVERS[kind],), {"files": files, "lock": threading.Lock()})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()
