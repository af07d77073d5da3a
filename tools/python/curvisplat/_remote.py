"""Caches on a web server, read by HTTP ranges as they are drawn."""

from __future__ import annotations

import base64
import email.message
import errno
import http.client
import os
import re
import socket
import ssl
import tempfile
import threading
import urllib.parse
import urllib.request
import weakref
from typing import Any, Callable, Dict, List, Mapping, Optional, Set, Tuple, Union

from . import _core

_TRIES = 4
_FIRST_PAUSE_S = 0.25  # doubled after each try
_TIMEOUT_S = 20
_MAX_REDIRECTS = 5


class _Failure(Exception):
    """The server cannot give what is asked for; another try would not help. `code`: of errno."""

    def __init__(self, message: str, code: int = errno.EIO):
        super().__init__(message)
        self.code = code


class _Answer:
    """The status and headers of an answer, and its body, of which no more was read than can be used."""

    def __init__(self, status: int, reason: str, headers: email.message.Message, body: bytes):
        self.status, self.reason, self.headers, self.body = status, reason, headers, body


def is_address(path: Any) -> bool:
    """Whether open() gets an address instead of a folder."""
    return isinstance(path, str) and re.match(r"https?://", path, re.IGNORECASE) is not None


class _Connections:
    """Connections to servers, kept from one request to the next. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # what handles a signal may use it, too
        self._idle: Dict[Tuple[str, str], List[http.client.HTTPConnection]] = {}
        self._in_use: Set[http.client.HTTPConnection] = set()

    def take(self, scheme: str, place: str) -> http.client.HTTPConnection:
        with self._lock:
            idle = self._idle.get((scheme, place))
            connection = idle.pop() if idle else self._new(scheme, place)
            self._in_use.add(connection)
            return connection

    def give_back(self, scheme: str, place: str, connection: http.client.HTTPConnection, reusable: bool) -> None:
        with self._lock:
            self._in_use.discard(connection)
            if reusable:
                self._idle.setdefault((scheme, place), []).append(connection)
                return
        connection.close()

    def interrupt(self) -> None:
        """Ends what is being sent, whoever waits for it."""
        with self._lock:
            sockets = [connection.sock for connection in self._in_use]
        for each in sockets:
            try:
                if each:
                    each.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # it has ended

    def __del__(self) -> None:
        for connections in self._idle.values():
            for connection in connections:
                connection.close()

    @staticmethod
    def _new(scheme: str, place: str) -> http.client.HTTPConnection:
        kind = http.client.HTTPSConnection if scheme == "https" else http.client.HTTPConnection
        proxy = urllib.request.getproxies().get(scheme)
        if not proxy or urllib.request.proxy_bypass(place.rsplit(":", 1)[0]):
            return kind(place, timeout=_TIMEOUT_S)
        connection = kind(urllib.parse.urlsplit(proxy if "//" in proxy else "//" + proxy).netloc, timeout=_TIMEOUT_S)
        connection.set_tunnel(place)
        return connection


class Remote:
    """A cache's files on a server. Several threads fetch at once."""

    def __init__(self, url: str, headers: Optional[Mapping[str, str]]):
        parts = urllib.parse.urlsplit(url)
        if not parts.hostname:
            raise _core.UsageError(f"{url}: has no host; expected http://HOST/PATH/NAME.splats")
        try:
            port = parts.port
        except ValueError:
            raise _core.UsageError(f"{parts.hostname}: its port is not a number from 0 to 65535") from None
        host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
        self._headers = {"Accept-Encoding": "identity", "User-Agent": f"curvisplat/{_core.version}", **(headers or {})}
        if parts.username is not None:
            names = f"{urllib.parse.unquote(parts.username)}:{urllib.parse.unquote(parts.password or '')}"
            self._headers["Authorization"] = "Basic " + base64.b64encode(names.encode()).decode()
        self._parts = parts._replace(netloc=host + (f":{port}" if port else ""), path=urllib.parse.quote(parts.path.rstrip("/"), safe="/%~:@!$&'()*+,;="),
                                     fragment="")
        self.url = urllib.parse.urlunsplit(self._parts._replace(query=""))  # for messages: a query may be a secret
        self._addresses: Dict[str, str] = {}  # where files are after redirections
        self._tags: Dict[str, Tuple[int, Optional[str]]] = {}  # size and tag of each file, as they were first sent
        self._connections = _Connections()
        self._stop = threading.Event()
        self._lock = threading.RLock()  # what handles a signal may use it, too
        self._threads: List[int] = []  # those that are in call()
        self._failure: Optional[BaseException] = None
        self._folder = ""  # in which the files are known to the module

    def mirror(self, parent: str) -> _core.RemoteFolder:
        """A folder in `parent` that has what the server has."""
        weak = weakref.ref(self)  # the folder, which has no part in the collection of cycles, must not keep what keeps it
        folder = self.call(_core.RemoteFolder, parent, lambda *arguments: weak().fetch(*arguments))  # type: ignore[union-attr]
        self._folder = folder.path
        return folder

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Calls what may fetch, and raises what was wrong with the server."""
        with self._lock:
            if not self._threads:
                self._failure = None
                self._stop.clear()
            self._threads.append(threading.get_ident())
        try:
            return function(*arguments)
        except _core.Error as error:
            if isinstance(self._failure, _Failure):
                raise _core.Error(str(self._failure)) from None
            if self._failure is not None:
                raise self._failure from None
            raise type(error)(str(error).replace(self._folder, self.url)) from None
        finally:
            with self._lock:
                self._threads.remove(threading.get_ident())

    def interrupt(self) -> None:
        """Ends the requests of this thread's work."""
        if threading.get_ident() in self._threads:
            self._stop.set()
            self._connections.interrupt()

    def fetch(self, name: str, offset: int, count: int) -> Tuple[int, int, bytes]:
        """As _core.RemoteFolder calls it."""
        try:
            size, body = self._range(name, offset, count)
            return 0, size, body
        except _Failure as failure:
            if self._failure is None:
                self._failure = failure
            return failure.code, 0, b""
        except BaseException as error:  # KeyboardInterrupt, while a cache is opened
            self._failure = error
            return errno.EIO, 0, b""

    def _shown(self, name: str) -> str:
        return f"{self.url}/{name}"

    def _range(self, name: str, offset: int, count: int) -> Tuple[int, bytes]:
        """The size of a file, and bytes of it. Raises _Failure."""
        wrong = "no answer"
        for number in range(_TRIES):
            if number and self._stop.wait(_FIRST_PAUSE_S * 2 ** (number - 1)) or self._stop.is_set():
                raise _Failure(f"{self._shown(name)}: stopped")
            try:
                answer = self._request(name, offset, count)
            except ssl.SSLCertVerificationError as error:
                raise _Failure(f"{self._shown(name)}: the server's certificate is not trusted: {error.verify_message}") from None
            except (OSError, http.client.HTTPException) as error:
                wrong = str(error) or type(error).__name__
                continue
            if answer.status in (408, 425, 429, 500, 502, 503, 504):
                wrong = f"the server answered {answer.status} {answer.reason}"
                continue
            size, body = self._checked(name, offset, count, answer)
            if len(body) == max(0, min(offset + count, size) - offset):
                return size, body
            wrong = f"the connection was lost after {len(body)} of {count} bytes"
        raise _Failure(f"{self._shown(name)}: cannot be read, tried {_TRIES} times: {' '.join(wrong.split())}")

    def _checked(self, name: str, offset: int, count: int, answer: _Answer) -> Tuple[int, bytes]:
        """The size that the answer states, and its bytes. Raises _Failure if they are not those that were asked for."""
        shown = self._shown(name)
        if answer.status in (401, 403):
            raise _Failure(f"{shown}: the server refuses access ({answer.status}); pass headers={{'Authorization': ...}}", errno.EACCES)
        if answer.status in (404, 410):
            expected = "; expected the address of a splat cache, a directory NAME.splats" if name == "manifest.json" else ""
            raise _Failure(f"{shown}: not found ({answer.status}){expected}", errno.ENOENT)
        if answer.headers.get("Content-Encoding", "identity").lower() != "identity":
            raise _Failure(f"{shown}: the server sends it compressed ({answer.headers['Content-Encoding']}), so that its parts cannot be read")
        found = re.fullmatch(r"bytes (?:(\d{1,18})-(\d{1,18})|\*)/(\d{1,18})", answer.headers.get("Content-Range", "").strip())
        body = answer.body
        if answer.status == 206 and found and found[1]:
            begin, end, size = int(found[1]), int(found[2]) + 1, int(found[3])
            if begin != offset or end != min(offset + count, size) or len(body) > end - begin:
                raise _Failure(f"{shown}: the server sent bytes {begin}-{end - 1} of {size}, expected {count} from {offset}")
        elif answer.status == 416 and found and int(found[3]) <= offset:
            size, body = int(found[3]), b""
        elif answer.status == 200:
            self._require_same(name, None, answer)
            length = answer.headers.get("Content-Length", "")
            if offset > 0 or not length.isdigit() or int(length) > count:
                raise _Failure(f"{shown}: the server does not send parts of files (HTTP ranges); use one that does, or copy the cache to this machine")
            size = int(length)
        else:
            raise _Failure(f"{shown}: the server answered {answer.status} {answer.reason}".rstrip())
        self._require_same(name, size, answer)
        return size, body

    def _require_same(self, name: str, size: Optional[int], answer: _Answer) -> None:
        """Raises _Failure if the file is not the one that was first read; a size of None is unknown."""
        tag = answer.headers.get("ETag") or answer.headers.get("Last-Modified")
        with self._lock:
            known_size, known_tag = self._tags.setdefault(name, (size, tag)) if size is not None else self._tags.get(name, (None, None))
        if size is not None and known_size != size or known_tag is not None and tag is not None and tag != known_tag:
            raise _Failure(f"{self._shown(name)}: has changed on the server; open the cache again")

    def _request(self, name: str, offset: int, count: int) -> _Answer:
        address = self._addresses.get(name) or urllib.parse.urlunsplit(self._parts._replace(path=f"{self._parts.path}/{urllib.parse.quote(name)}"))
        for _ in range(_MAX_REDIRECTS + 1):
            answer = self._request_at(address, name, offset, count)
            if answer.status not in (301, 302, 303, 307, 308) or "Location" not in answer.headers:
                self._addresses[name] = address
                return answer
            target = urllib.parse.urljoin(address, answer.headers["Location"])
            if not is_address(target) or address.lower().startswith("https:") and not target.lower().startswith("https:"):
                raise _Failure(f"{self._shown(name)}: the server redirects to an address that is not secure, or not of HTTP")
            address = target
        raise _Failure(f"{self._shown(name)}: the server redirects more than {_MAX_REDIRECTS} times")

    def _request_at(self, address: str, name: str, offset: int, count: int) -> _Answer:
        parts = urllib.parse.urlsplit(address)
        headers = {**self._headers, "Range": f"bytes={offset}-{offset + count - 1}"}
        if parts.netloc != self._parts.netloc:
            headers.pop("Authorization", None)  # another server's
        tag = self._tags.get(name, (None, None))[1]
        if tag is not None and tag.startswith('"'):
            headers["If-Range"] = tag
        connection = self._connections.take(parts.scheme, parts.netloc)
        reusable = False
        try:
            connection.request("GET", urllib.parse.urlunsplit(("", "", parts.path or "/", parts.query, "")), headers=headers)
            if self._stop.is_set():
                raise _Failure(f"{self._shown(name)}: stopped")
            response = connection.getresponse()
            body = b""
            if response.status in (200, 206):
                while len(body) <= count:  # one more shows that there are too many
                    piece = response.read(count + 1 - len(body))
                    if not piece:
                        break
                    body += piece
            reusable = response.isclosed() and not response.will_close
            return _Answer(response.status, response.reason, response.headers, body)
        finally:
            self._connections.give_back(parts.scheme, parts.netloc, connection, reusable)


class RemoteCore:
    """Stands for _core.OpenCache of a cache on a server: its errors name the server."""

    def __init__(self, remote: Remote, folder: Union[str, os.PathLike]):
        self._remote = remote
        self._folder = remote.mirror(os.fspath(folder))
        self._core = remote.call(_core.OpenCache, self._folder)
        self.path = remote.url

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        value = self._remote.call(getattr, self._core, name)
        return (lambda *arguments: self._remote.call(value, *arguments)) if callable(value) else value

    @property
    def fetched_bytes(self) -> int:
        return self._folder.fetched_bytes


_remotes: "weakref.WeakSet[Remote]" = weakref.WeakSet()


def _interrupt() -> None:
    for remote in list(_remotes):
        remote.interrupt()


def _forked() -> None:
    """Another thread may have held a lock, and is not in the new process."""
    for remote in list(_remotes):
        remote._lock = threading.RLock()


os.register_at_fork(after_in_child=_forked)


def opened(url: str, headers: Optional[Mapping[str, str]], folder: Union[str, os.PathLike, None]) -> RemoteCore:
    """An open cache on a server."""
    remote = Remote(url, headers)
    _remotes.add(remote)
    _core.set_interrupt_hook(_interrupt)
    return RemoteCore(remote, tempfile.gettempdir() if folder is None else folder)
