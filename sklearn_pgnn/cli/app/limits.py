"""How much the page takes: of bytes, of files, of visitors, of time."""

#: largest model file and largest file of records [byte], and largest sum of them
MODEL_BYTES, RECORD_BYTES, ALL_BYTES = 1_000_000, 50_000_000, 200_000_000
#: largest other request [byte]
FORM_BYTES = 100_000
#: files of records of a visitor
RECORDS = 50
#: visitors at the same time, and time after which one who does nothing is forgotten [s]
VISITORS, IDLE = 16, 3600.0
#: time after which what should take seconds is ended [s]
PATIENCE = 120.0
#: characters of a file's name that are kept
NAME = 80
