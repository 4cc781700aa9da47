import './renderview.js'

const image = document.getElementById('view')
const overlay = document.getElementById('overlay')
let socket = null
let pending = null
let lastSource = null

class View extends window.BaseRenderView {
  onEvent (event) {
    if (socket !== null && socket.readyState === 1) socket.send(JSON.stringify(event))
  }
}
const view = new View(image, null)
view.setThrottle(8)

function connect () {
  socket = new WebSocket(location.href.replace(/^http/, 'ws'))
  socket.binaryType = 'blob'
  socket.onmessage = ({ data }) => {
    if (typeof data === 'string') {
      const message = JSON.parse(data)
      if (message.type === 'framebufferdata') pending = message
    } else if (pending !== null) {
      show(pending, data)
      pending = null
    }
  }
}

function show (message, data) {
  const source = URL.createObjectURL(new Blob([data], { type: message.mimetype }))
  image.onload = () => {
    if (lastSource) URL.revokeObjectURL(lastSource)
    lastSource = source
    window.status_ = message.status
    overlay.textContent = JSON.stringify(message.status)
    socket.send(JSON.stringify({ type: '_framefeedback', index: message.index, timestamp: message.timestamp, localtime: Date.now() / 1000 }))
  }
  image.src = source
}
connect()
