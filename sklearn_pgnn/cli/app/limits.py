"""How much the page takes: of bytes, of files, of memory, of time."""

#: largest model file and largest file of records [byte], and largest sum of them
MODEL_BYTES, RECORD_BYTES, ALL_BYTES = 1_000_000, 50_000_000, 200_000_000
#: largest other request [byte]
FORM_BYTES = 100_000
#: files of records
RECORDS = 50
#: most memory of the process that reads and diagnoses [byte]
MEMORY = 8_000_000_000
#: time after which what should take seconds is ended [s]
PATIENCE = 120.0
#: characters of a file's name that are kept
NAME = 80
