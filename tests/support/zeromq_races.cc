/// For tests with sockets: ZeroMQ, which is not instrumented, hands memory from thread to thread by
/// means that ThreadSanitizer does not see. Asked for by ThreadSanitizer, unused elsewhere.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() {
  return "race:libzmq.so\nrace:libsodium.so\n";
}
