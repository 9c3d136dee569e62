"""What a hostile program tries to read, write and reach; runs as the node, as setup.py, as CMake.

Each function tries one thing and returns what it got hold of; any exception means that it was
refused. `TARGETS` is filled in by the test: files and listeners that it made itself.
"""

import ctypes
import fcntl
import glob
import os
import platform
import signal
import socket
import sys

TARGETS = {}
LIBC = ctypes.CDLL(None, use_errno=True)
SYSCALLS = {
    'x86_64': dict(ptrace=101, mount=165, pivot_root=155, add_key=248, keyctl=250, bpf=321,
                   perf_event_open=298, userfaultfd=323, io_uring_setup=425, memfd_create=319,
                   kexec_load=246, open_by_handle_at=304, process_vm_readv=310, shmget=29),
}.get(platform.machine(), {})


def syscall(name, *arguments):
    if LIBC.syscall(SYSCALLS[name], *arguments) == -1:
        raise OSError(ctypes.get_errno(), name)
    return name


def descriptors():
    found = {}
    for fd in map(int, os.listdir('/proc/self/fd')):
        try:
            found[fd] = os.readlink(f'/proc/self/fd/{fd}')
        except OSError:
            continue
    return found


INHERITED = descriptors()


def read(path):
    with open(path, 'rb') as file:
        return file.read(64)


def write(path):
    with open(path, 'ab') as file:
        file.write(b'# owned\n')
    return path


def read_other_submission():
    found = glob.glob(TARGETS['cache'] + '/builds/*/build.json')
    return found[0]


def import_rosgrade():
    import grader.grade.judging
    return grader.grade.judging.__file__


def import_library_of_rosgrade():
    import pydantic
    return pydantic.BaseModel


def read_environment_of_the_grader():
    marker = TARGETS['marker'].encode()
    for pid in filter(str.isdigit, os.listdir('/proc')):
        try:
            if marker in read_all(f'/proc/{pid}/environ'):
                return pid
        except OSError:
            continue
    raise PermissionError('no process with that variable')


def read_all(path):
    with open(path, 'rb') as file:
        return file.read()


def read_command_line_of_the_grader():
    for pid in filter(str.isdigit, os.listdir('/proc')):
        if TARGETS['marker'].encode() in read_all(f'/proc/{pid}/cmdline'):
            return pid
    raise PermissionError('no such process')


def plant_in_site_packages():
    path = os.path.join(TARGETS['prefix'], 'lib', f'python3.{sys.version_info[1]}', 'site-packages')
    return write(path + '/planted_by_an_attack.pth')


def write_to_system():
    for path in ('/usr/lib/planted', '/etc/planted', '/planted', '/dev/planted', '/bin/planted'):
        try:
            return write(path)
        except OSError:
            continue
    raise PermissionError('read-only')


def write_beside_the_libraries():
    # What is mounted over something else, and has no bound of its own.
    for line in open('/proc/self/mounts'):
        place, kind, options = line.split()[1:4]
        if kind == 'tmpfs' and 'size=' not in options and place.startswith(sys.base_prefix):
            try:
                return write(place + '/planted')
            except OSError:
                continue
    raise PermissionError('nothing of that kind')


def reach_listener_on_loopback():
    with socket.create_connection(('127.0.0.1', TARGETS['port']), 1) as connection:
        return connection.recv(16)


def reach_abstract_socket():
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect('\0' + TARGETS['marker'])
        return connection.recv(16)


def reach_socket_file():
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(TARGETS['socket'])
        return connection.recv(16)


def find_another_interface():
    names = [name for _, name in socket.if_nameindex() if name != 'lo']
    routes = open('/proc/net/route').read().splitlines()[1:]
    if not names and not routes:
        raise OSError('only lo')
    return names


def open_vsock_with_high_bits():
    # The kernel looks at 32 bits of the 64.
    if LIBC.syscall(41, ctypes.c_uint64((1 << 32) | 40), 1, 0) == -1:
        raise OSError(ctypes.get_errno(), 'socket')


def read_memory_of_parent():
    buffer = ctypes.create_string_buffer(8)
    vector = (ctypes.c_void_p * 2)(ctypes.addressof(buffer), 8)
    return syscall('process_vm_readv', os.getppid(), vector, 1, vector, 1, 0)


def enter_namespace():
    if LIBC.unshare(0x10000000) == -1:
        raise OSError(ctypes.get_errno(), 'unshare')


def clone_into_namespace():
    # CLONE_NEWUSER | SIGCHLD
    pid = LIBC.syscall(56, 0x10000000 | signal.SIGCHLD, 0, 0, 0, 0)
    if pid == -1:
        raise OSError(ctypes.get_errno(), 'clone')
    if pid == 0:
        os._exit(0)
    os.waitpid(pid, 0)


def change_root():
    os.chroot('/tmp')
    return True


def become_root():
    os.setuid(0)
    return True


def make_device():
    os.mknod('/tmp/disk', 0o060600, os.makedev(8, 0))
    return open('/tmp/disk', 'rb').read(1)


def push_into_terminal():
    master, slave = os.openpty()
    fcntl.ioctl(slave, 0x5412, b'x')
    return True


def inherit_descriptors():
    allowed = {0, 1, 2, int(os.environ.get('ROSGRADE_TRACER_FD', 0)),
               int(os.environ.get('ROSGRADE_SEEN_FD', 0)),
               int(os.environ.get('ROSGRADE_PAUSE_FD', 0))}
    found = [name for fd, name in INHERITED.items()
             if fd not in allowed and not name.startswith('/proc')
             and not name.endswith(('setup.py', 'spy.py', 'CMakeConfigureLog.yaml'))]
    if not found:
        raise OSError('none')
    return found


def call_as_32_bit_program():
    import mmap
    pid = os.fork()
    if pid == 0:
        memory = mmap.mmap(-1, 4096, prot=7)
        memory.write(b'\xb8\x14\x00\x00\x00\xcd\x80\xc3')
        ctypes.CFUNCTYPE(ctypes.c_int)(ctypes.addressof(ctypes.c_char.from_buffer(memory)))()
        os._exit(0)
    status = os.waitpid(pid, 0)[1]
    if os.WIFSIGNALED(status):
        raise OSError(f'signal {os.WTERMSIG(status)}')


SIMPLE = {
    'read_hidden_checks': lambda: read(TARGETS['hidden']),
    'read_instructors_home': lambda: read(TARGETS['home']),
    'read_reference': lambda: os.listdir(TARGETS['repository'] + '/reference'),
    'read_assignments': lambda: os.listdir(TARGETS['repository'] + '/assignments'),
    'read_code_of_rosgrade': lambda: read(TARGETS['repository'] + '/grader/grade/judging.py'),
    'read_host_password_file': lambda: read('/etc/shadow'),
    'forge_result': lambda: write(TARGETS['result']),
    'plant_in_cache': lambda: write(glob.glob(TARGETS['cache'] + '/python/*')[0] + '/planted'),
    'open_vsock': lambda: socket.socket(40, socket.SOCK_STREAM),
    'open_raw_socket': lambda: socket.socket(socket.AF_PACKET, socket.SOCK_RAW),
    'open_bluetooth_socket': lambda: socket.socket(31, socket.SOCK_RAW, 1),
    'trace_parent': lambda: syscall('ptrace', 16, os.getppid(), 0, 0),
    'mount_something': lambda: syscall('mount', b'none', b'/tmp', b'tmpfs', 0, 0),
    'add_key': lambda: syscall('add_key', b'user', b'rosgrade', b'x', 1, -3),
    'load_program_into_kernel': lambda: syscall('bpf', 0, 0, 0),
    'watch_the_cpu':
        lambda: syscall('perf_event_open', ctypes.create_string_buffer(128), 0, -1, -1, 0),
    'use_io_uring': lambda: syscall('io_uring_setup', 1, ctypes.create_string_buffer(128)),
    'hide_memory_in_a_file': lambda: syscall('memfd_create', b'x', 0),
    'hide_memory_in_a_segment': lambda: syscall('shmget', 0, 4096, 0o1600),
    'open_by_handle': lambda: syscall('open_by_handle_at', -1, 0, 0),
}
# A node is ended for these, so they are tried one by one: see test_hostile.py.
NOTICED = ('trace_parent', 'read_memory_of_parent', 'load_program_into_kernel', 'open_by_handle')
HELPERS = ('read', 'read_all', 'write', 'syscall', 'descriptors')
ATTACKS = {**SIMPLE, **{name: value for name, value in list(globals().items())
                        if callable(value) and getattr(value, '__module__', None) == __name__
                        and name not in HELPERS}}


def main(but=(), only=ATTACKS):
    for name in ATTACKS:
        if name in but or name not in only:
            continue
        try:
            got = ATTACKS[name]()
        except BaseException as error:
            print(f'ATTACK {name} refused {type(error).__name__}: {error}', file=sys.stderr)
        else:
            print(f'ATTACK {name} succeeded {got!r}', file=sys.stderr)


if __name__ == '__main__':
    main()
