"""The recorded stack run again on a log's inputs, alone or beside a changed one."""
