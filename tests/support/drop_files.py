#!/usr/bin/env python3
"""Drops files on a window, as a file manager does (XDND, version 5), through Xlib.

    drop_files.py WINDOW X Y FILE...     WINDOW: its number (xdotool search); X, Y: a place on the screen

Ends when the window has taken the files; exit status 1 if it does not within 20 seconds. Needs DISPLAY and libX11.
"""
import ctypes
import pathlib
import sys
import time

Atom = Window = ctypes.c_ulong


class ClientMessage(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p),
                ("window", Window), ("message_type", Atom), ("format", ctypes.c_int), ("data", ctypes.c_long * 5)]


class SelectionRequest(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p),
                ("owner", Window), ("requestor", Window), ("selection", Atom), ("target", Atom), ("property", Atom),
                ("time", ctypes.c_ulong)]


class SelectionNotify(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p),
                ("requestor", Window), ("selection", Atom), ("target", Atom), ("property", Atom), ("time", ctypes.c_ulong)]


class Event(ctypes.Union):
    _fields_ = [("type", ctypes.c_int), ("client", ClientMessage), ("request", SelectionRequest), ("notify", SelectionNotify),
                ("room", ctypes.c_long * 24)]


CLIENT_MESSAGE, SELECTION_REQUEST, SELECTION_NOTIFY = 33, 30, 31


def main():
    target, x, y = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    files = "".join(pathlib.Path(file).absolute().as_uri() + "\r\n" for file in sys.argv[4:]).encode()
    lib = ctypes.CDLL("libX11.so.6")
    lib.XOpenDisplay.restype = ctypes.c_void_p
    lib.XInternAtom.restype = lib.XDefaultRootWindow.restype = lib.XCreateSimpleWindow.restype = ctypes.c_ulong
    display = ctypes.c_void_p(lib.XOpenDisplay(None))
    atom = lambda name: lib.XInternAtom(display, name.encode(), 0)
    root = ctypes.c_ulong(lib.XDefaultRootWindow(display))
    own = lib.XCreateSimpleWindow(display, root, 0, 0, 1, 1, 0, ctypes.c_ulong(0), ctypes.c_ulong(0))
    lib.XSetSelectionOwner(display, Atom(atom("XdndSelection")), Window(own), ctypes.c_ulong(0))

    def send(name, *data):
        event = Event()
        event.client = ClientMessage(CLIENT_MESSAGE, 0, 1, display, target, atom(name), 32, (ctypes.c_long * 5)(own, *data))
        lib.XSendEvent(display, Window(target), 0, ctypes.c_long(0), ctypes.byref(event))
        lib.XFlush(display)

    send("XdndEnter", 5 << 24, atom("text/uri-list"), 0, 0)
    send("XdndPosition", 0, x << 16 | y, 0, atom("XdndActionCopy"))
    deadline, event = time.monotonic() + 20, Event()
    while time.monotonic() < deadline:
        if not lib.XPending(display):
            time.sleep(0.005)
            continue
        lib.XNextEvent(display, ctypes.byref(event))
        if event.type == CLIENT_MESSAGE and event.client.message_type == atom("XdndStatus"):
            send("XdndDrop", 0, 0, 0, 0)
        elif event.type == CLIENT_MESSAGE and event.client.message_type == atom("XdndFinished"):
            return 0
        elif event.type == SELECTION_REQUEST:
            asked = event.request
            lib.XChangeProperty(display, Window(asked.requestor), Atom(asked.property), Atom(asked.target), 8, 0, files, len(files))
            answer = Event()
            answer.notify = SelectionNotify(SELECTION_NOTIFY, 0, 1, display, asked.requestor, asked.selection, asked.target,
                                            asked.property, asked.time)
            lib.XSendEvent(display, Window(asked.requestor), 0, ctypes.c_long(0), ctypes.byref(answer))
            lib.XFlush(display)
    print("the window did not take the files", file=sys.stderr)
    return 1


sys.exit(main())
