#pragma once
// What can go wrong outside of Pietra, as exceptions that main() turns into the exit codes of the
// command line. Thrown while building and by the verbs; untrusted bytes of a model and the frame
// path use `Result` types instead and never throw. Messages are one sentence, name the file and the
// place, and are tested.

#include <cstdint>
#include <stdexcept>
#include <string>

namespace pietra {

/// Base of all errors that are not Pietra's fault. `exitCode()` is the process's exit status.
class Error : public std::runtime_error {
public:
    Error(int exit_code, const std::string& message)
        : std::runtime_error(message), exit_code_(exit_code) {}
    int exitCode() const { return exit_code_; }

private:
    int exit_code_;
};

/// Wrong use of the command line, or an output that exists without --force. Exit 2.
class UsageError : public Error {
public:
    explicit UsageError(const std::string& message) : Error(2, message) {}
};

/// A file whose content is wrong: "FILE: PLACE: WHAT". Exit 3.
class InputError : public Error {
public:
    InputError(const std::string& path, const std::string& place, const std::string& what);
    /// The fault is at a byte offset.
    static InputError atByte(const std::string& path, uint64_t offset, const std::string& what);
    /// The fault is on a line, counted from 1.
    static InputError atLine(const std::string& path, uint64_t line, const std::string& what);
};

/// The operating system refused: no such file, no permission, disk full. Exit 4.
class IoError : public Error {
public:
    /// `operation`: "open", "read", "write", ...; `error_number`: errno of the failed call.
    IoError(const std::string& path, const std::string& operation, int error_number);
};

/// The work does not fit the memory limit given. Exit 5.
class MemoryError : public Error {
public:
    explicit MemoryError(const std::string& message) : Error(5, message) {}
};

/// The user interrupted the work (SIGINT, SIGTERM). Exit 130.
class Interrupted : public Error {
public:
    Interrupted() : Error(130, "interrupted") {}
};

}  // namespace pietra
