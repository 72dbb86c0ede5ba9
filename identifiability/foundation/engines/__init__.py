"""Where long work runs: here, in processes, on a cluster, with or without a memory.

`mapping` is the protocol that everything else sees; the engines themselves are imported from
`local` and `cluster` when they are asked for, because they are heavy.
"""
